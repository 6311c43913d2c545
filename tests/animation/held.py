"""Props and the hands that hold them, and their displayed world matrices. Metres, frames of the scene."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from rigid_motion.animation import hold_facts, hold_in, refresh, set_mode
from tests.animation.bones.rigs import HANDS, Rest, key_all, new_rig
from tests.animation.keyed import Carrier, curves_of, rotation_path
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object

PLAYED = np.arange(1.0, 91.0)

WITH_PROP = (*HANDS, Rest("Prop", (0.1, 0.4, 0.8), (0.1, 0.5, 0.9), "Body", roll=0.5))


def worlds(carrier: Carrier, frames: Sequence[float] = PLAYED) -> np.ndarray:
    """Return the displayed world matrices of an object or a bone, (m, 4, 4)."""
    return shown_worlds([carrier], frames)[0]


def in_holder(prop: Carrier, holder: Carrier, frames: Sequence[float]) -> np.ndarray:
    """Return a prop's matrices relative to its holder."""
    return np.linalg.inv(worlds(holder, frames)) @ worlds(prop, frames)


def holders_on(prop: Carrier, frames: Sequence[int]) -> list[str]:
    """Return the names of a prop's holders on frames, empty where nothing holds it."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        now = hold_facts(prop).now
        result.append("" if now is None else now.name)
    return result


def new_prop(kind: str) -> Carrier:
    """Return a quaternion object, an object with angles on a moving parent (possibly scaled, or a bone), or a bone."""
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 90
    if kind == "bone":
        rig = new_rig("Quiver", WITH_PROP)
        wander(rig.pose.bones["Body"], 3)
        return rig.pose.bones["Prop"]
    prop = new_object("Tool", "QUATERNION" if kind == "free" else "XZY")
    if kind in ("parented", "scaled"):
        prop.parent = new_object("Table")
        prop.matrix_parent_inverse = Matrix.Translation((0.1, 0.2, -0.1))
        wander(prop.parent, 4)
        prop.parent.scale = 3 * (1.7 if kind == "scaled" else 1.0,)
    if kind == "hung":
        rig = new_rig("Holster", HANDS)
        wander(rig.pose.bones["Hand.L"], 5)
        prop.parent, prop.parent_type, prop.parent_bone = rig, "BONE", "Hand.L"
    return prop


KINDS = ("free", "parented", "scaled", "hung", "bone")


def raise_keys(carrier: Carrier, by: float) -> None:
    """Add to the values of all its keys."""
    for fcurve in curves_of(carrier).values():
        for point in fcurve.keyframe_points:
            point.co_ui.y += by
    bpy.context.view_layer.update()


def wander(carrier: Carrier, seed: int, frames: Sequence[float] = (1.0, 20.0, 37.0, 60.0, 90.0)) -> None:
    """Key random poses."""
    random = np.random.default_rng(seed)
    for frame in frames:
        put(
            carrier,
            frame,
            random.uniform(-0.4, 0.4, 3),
            Quaternion(np.add(random.normal(size=4), (2.0, 0.0, 0.0, 0.0))),
        )


def put(carrier: Carrier, frame: float, location: Sequence[float], turn: Quaternion) -> None:
    """Key location and rotation of channels."""
    path = rotation_path(carrier)
    carrier.location, turn = location, turn.normalized()
    setattr(carrier, path, turn if path == "rotation_quaternion" else turn.to_euler(carrier.rotation_mode))
    for name in ("location", path):
        carrier.keyframe_insert(name, frame=frame)


def new_hands() -> tuple[Carrier, Carrier]:
    """Return two hands of a rig that moves them."""
    rig = key_all(new_rig("Hands", HANDS), frames=(1.0, 17.0, 36.0, 52.0, 71.0, 90.0))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    return rig.pose.bones["Hand.L"], rig.pose.bones["Hand.R"]


def handled(prop: Carrier, *hands: Carrier, throw: int = 3) -> None:
    """Make a prop move, get picked up at 20, turned in the hand at 28, passed over 36 to 40, and thrown at 60."""
    wander(prop, 7, (1.0, 9.0, 15.0))
    scene = bpy.context.scene
    for frame, hand, frames in ((20, hands[0], 0), (40, hands[1], 4), (60, None, throw)):
        scene.frame_set(frame)
        hold_in(prop, hand, frames=frames)
        if frame == 20:
            put(prop, 28.0, np.array(prop.location) + 0.1, Quaternion((1.0, 0.3, -0.2, 0.1)))
    wander(prop, 9, (70.0, 80.0))
    bpy.context.view_layer.update()
    refresh()
