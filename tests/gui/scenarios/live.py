"""Live streaming from another program: a performer with a sword is received, recorded, undone, replayed and edited."""

from __future__ import annotations

import socket
import time
from importlib import import_module

import bpy
import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import placed
from rigid_motion.streams import Sender, StreamBody
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import extension, on_screen
from tests.live.performing import BODY, JOINTS, dance, heads_of, in_world, new_rig

RATE = 60
GRIP = Poses([0.1, 0.0, 0.05], [0.8, 0.6, 0.0, 0.0])
HAND = "LeftHand"
TAKEN = 2.0
"""Time in seconds at which the hand takes the sword."""

SLIP = 2e-6
"""Tolerance of single precision for the sword in the hand."""

MOVED = 0.01
"""A dancing performer soon moves more than this, in metres."""


class Program:
    """A sending program: a performer who takes a sword, in real time."""

    def __init__(self, port: int) -> None:
        self._socket, self._to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", port)
        self._sender = Sender([BODY, StreamBody.rigid("sword", radius=0.1)], rate=RATE)
        self._began, self._sent = time.monotonic(), 0
        # Blender identifies timers by identity, and a bound method is a new object each time.
        self._timer = self._send
        bpy.app.timers.register(self._timer, persistent=True)

    def _send(self) -> float:
        due = int((time.monotonic() - self._began) * RATE)
        for row in range(self._sent, due):
            for datagram in self.datagrams(row / RATE):
                self._socket.sendto(datagram, self._to)
        self._sent = due
        return 0.5 / RATE

    def datagrams(self, moment: float) -> list[bytes]:
        poses = dance(np.array([moment]))
        sword = placed(in_world(poses)[JOINTS.index(HAND)], GRIP)
        if moment < TAKEN:
            sword = Poses([[0.6, -0.4, 0.8]], [[1.0, 0.0, 0.0, 0.0]])
        else:
            self._sender.hold("sword", BODY.name, HAND)
        return self._sender.add(moment, {BODY.name: poses[:, 0], "sword": sword})

    def close(self) -> None:
        bpy.app.timers.unregister(self._timer)
        self._socket.close()


def free_port() -> int:
    """Return a free UDP port, which no other window of the tests uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def rig() -> bpy.types.Object:
    """Return the rig, looked up each time: undo replaces it."""
    return bpy.data.objects["Rig"]


def sword() -> bpy.types.Object:
    return bpy.data.objects["sword"]


def grips(frames: range) -> np.ndarray:
    """Return the sword's matrices in the hand on these frames, (n, 4, 4)."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        hand = rig().evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones[HAND].matrix
        result.append(np.linalg.inv(on_screen("Rig") @ np.array(hand)) @ on_screen("sword"))
    return np.array(result)


def curves_of(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    (bag,) = obj.animation_data.action.layers[0].strips[0].channelbags
    return list(bag.fcurves)


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
    assert receiving.listening() is None, "nothing listens until it is asked to"

    header = x, y = yield from hand.find_button(view, "UI", "rigid_motion.live_listen", narrow=True)
    yield from hand.click((x + 60, y))  # the header, to unfold the panel
    yield from hand.click(header)
    program = Program(live.port)
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
    # Undo and redo by keys while the performer goes on.
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: not sword().constraints and not sword().animation_data, "one undo takes it back")
    before = heads_of(rig())
    yield from hand.wait_until(
        lambda: np.abs(heads_of(rig()) - before).max() > MOVED, "the performer still moves the rig"
    )
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: len(sword().constraints) == 1, "redone")
    yield from hand.click(header)
    yield from hand.wait_until(lambda: receiving.listening() is None, "the button of the header closes the port")
    program.close()

    influence = next(curve for curve in curves_of(sword()) if curve.data_path.endswith(".influence"))
    taken = int(np.ceil(influence.keyframe_points[1].co.x))
    frames = range(taken, int(rig().animation_data.action.frame_range[1]))
    recorded = grips(frames)
    yield from hand.picture("played-again")
    for curve in curves_of(rig()):
        curve.mute |= '"LeftUpperArm"' in curve.data_path
    arm = rig().pose.bones["LeftUpperArm"]
    arm.rotation_mode, arm.rotation_euler = "XYZ", (0.2, -0.9, 0.7)
    assert np.abs(grips(frames) - recorded).max() < SLIP
    yield from hand.picture("edited")
