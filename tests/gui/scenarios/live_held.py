"""A sword in the hand of a performer comes by this program's stream; it is recorded, and the arm is edited."""

from __future__ import annotations

from importlib import import_module

import bpy
import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import placed
from rigid_motion.streams import Sender, StreamBody
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.live_bodies import RATE, Program, free_port, rig
from tests.gui.scenarios.panel_notes import extension
from tests.live.performing import BODY, JOINTS, dance, in_world, new_rig

GRIP = Poses([0.1, 0.0, 0.05], [0.8, 0.6, 0.0, 0.0])
HAND = "LeftHand"
TAKEN = 2.0
"""Seconds after which the hand takes the sword."""

SLIP = 2e-6
"""What single precision leaves of where the sword is in the hand."""


class Holding(Program):
    """Another program, that sends a performer who takes a sword."""

    def __init__(self, port: int) -> None:
        self._sender = Sender([BODY, StreamBody.rigid("sword", radius=0.1)], rate=RATE)
        super().__init__(port)

    def datagrams(self, row: int) -> list[bytes]:
        moment = row / RATE
        poses = dance(np.array([moment]))
        sword = placed(in_world(poses)[JOINTS.index(HAND)], GRIP)
        if moment < TAKEN:
            sword = Poses([[0.6, -0.4, 0.8]], [[1.0, 0.0, 0.0, 0.0]])
        else:
            self._sender.hold("sword", BODY.name, HAND)
        return self._sender.add(moment, {BODY.name: poses[:, 0], "sword": sword})


def sword() -> bpy.types.Object:
    return bpy.data.objects["sword"]


def grip() -> np.ndarray:
    """Where the sword is in the hand, (4, 4)."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = rig().evaluated_get(depsgraph)
    hand = np.array(seen.matrix_world @ seen.pose.bones[HAND].matrix)
    return np.linalg.inv(hand) @ np.array(sword().evaluated_get(depsgraph).matrix_world)


def grips(frames: range) -> np.ndarray:
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        result.append(grip())
    return np.array(result)


def scenario(hand: Hand) -> Steps[None]:
    receiving = import_module(f"{extension().module}.live.receiving")
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    new_rig()
    rig().show_in_front = True
    live = bpy.context.scene.rigid_motion_live
    live.armature, live.port = rig(), free_port()
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.2, 0.0, 1.1), 4.0
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.open_sidebar(view, "Animation")
    bpy.ops.rigid_motion.live_listen()
    program = Holding(live.port)
    yield from hand.wait_until(
        lambda: receiving.listening() and len(receiving.listening().joints) == 2, "both are heard"
    )
    bpy.ops.rigid_motion.live_record()
    heard = lambda: {it.label: it for it in receiving.listening()._heard.values()}["sword"]  # noqa: E731
    yield from hand.wait_until(lambda: heard().held is not None, "the hand takes the sword")
    yield 1.0
    yield from hand.picture("live")
    bpy.ops.rigid_motion.live_finish("EXEC_DEFAULT", True)
    yield from hand.wait_until(lambda: len(sword().constraints) == 1, "the recording is held in the hand")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: not sword().constraints and not sword().animation_data, "one undo takes it back")
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: len(sword().constraints) == 1, "redone")
    receiving.stop()
    program.close()

    influence = next(curve for curve in curves_of(sword()) if curve.data_path.endswith(".influence"))
    taken = int(np.ceil(influence.keyframe_points[1].co.x))
    frames = range(taken, int(rig().animation_data.action.frame_range[1]))
    recorded = grips(frames)
    bpy.context.view_layer.objects.active = sword()
    sword().select_set(True)
    yield from hand.picture("played-again")
    for curve in curves_of(rig()):
        curve.mute |= '"LeftUpperArm"' in curve.data_path
    arm = rig().pose.bones["LeftUpperArm"]
    arm.rotation_mode, arm.rotation_euler = "XYZ", (0.2, -0.9, 0.7)
    assert np.abs(grips(frames) - recorded).max() < SLIP
    yield from hand.picture("edited")


def curves_of(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    (bag,) = obj.animation_data.action.layers[0].strips[0].channelbags
    return list(bag.fcurves)
