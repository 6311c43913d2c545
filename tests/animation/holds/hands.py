"""Hands of many kinds and the props they hold, set up as animators do. Metres, frames of the scene."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from rigid_motion.animation import hold_in
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.keyed import Carrier, rotation_path
from tests.animation.scenes import new_object, push_down, write

MOVES = np.array((1.0, 13.0, 22.0, 31.0, 46.0, 60.0, 80.0))
"""The key frames of hands."""

ARMS = (
    Rest("Body", (0.0, 0.0, 0.9), (0.0, 0.0, 1.4), roll=0.4),
    Rest("Upper", (0.2, 0.0, 1.4), (0.5, 0.05, 1.35), "Body", roll=-1.1),
    Rest("Lower", (0.5, 0.05, 1.35), (0.75, 0.15, 1.3), "Upper", (0.7)),
    Rest("Hand", (0.75, 0.15, 1.3), (0.83, 0.2, 1.28), "Lower", roll=0.7),
    Rest("Prop", (0.3, -0.3, 1.0), (0.35, -0.2, 1.1), "Body", roll=1.3),
    Rest("Twin", (0.3, -0.3, 1.0), (0.35, -0.2, 1.1), "Body", roll=1.3),
)
"""An arm on a body, and twice the same bone on the body, which is a prop."""


def wander(carrier: Carrier, seed: int, reach: float = 0.3, *, scale: bool = False) -> None:
    """Key location (not of bones if `reach` is 0) and rotation at random."""
    random = np.random.default_rng(seed)
    carrier.rotation_mode = "QUATERNION"
    channels = {}
    if reach:
        channels["location"] = reach * random.uniform(-1.0, 1.0, (len(MOVES), 3))
    values = random.normal((2.0, 0.0, 0.0, 0.0), size=(len(MOVES), 4))
    channels["rotation_quaternion"] = values / np.linalg.norm(values, axis=1, keepdims=True)
    if scale:
        channels["scale"] = np.repeat(np.exp(0.3 * random.normal(size=(len(MOVES), 1))), 3, axis=1)
    for path, values in channels.items():
        write(carrier, path, MOVES, values, "BEZIER")


def arm(name: str, seed: int = 0, **settings: object) -> bpy.types.Object:
    """Return a rig with a hand, keyed by FK."""
    rig = new_rig(name, ARMS, **settings)
    for number, bone in enumerate(("Body", "Upper", "Lower", "Hand")):
        wander(rig.pose.bones[bone], seed + number, 0.2 if bone == "Body" else 0.0)
    bpy.context.view_layer.update()
    return rig


def by_fk(name: str, seed: int) -> Carrier:
    return arm(name, seed).pose.bones["Hand"]


def by_ik(name: str, seed: int) -> Carrier:
    """Return a hand at the end of an IK arm with a moving target."""
    rig, goal = arm(name, seed), new_object(f"{name} goal")
    wander(goal, seed + 7)
    goal.delta_location = 0.6, 0.1, 1.2
    solver = rig.pose.bones["Lower"].constraints.new("IK")
    solver.target, solver.chain_count, solver.iterations = goal, 2, 50
    return rig.pose.bones["Hand"]


def in_a_scaled_strip(name: str, seed: int) -> Carrier:
    rig = arm(name, seed)
    push_down(rig, scale=1.7)
    return rig.pose.bones["Hand"]


def by_an_object(name: str, seed: int) -> Carrier:
    hand = new_object(name)
    wander(hand, seed)
    return hand


def on_a_scaled_parent(name: str, seed: int) -> Carrier:
    """Return a scaled object on a moving and scaled parent."""
    hand, parent = by_an_object(name, seed), new_object(f"{name} parent")
    wander(parent, seed + 5, 0.2)
    parent.scale = 3 * (1.7,)
    hand.parent, hand.scale = parent, (0.8, 0.8, 0.8)
    return hand


def on_one_that_grows(name: str, seed: int) -> Carrier:
    hand, parent = by_an_object(name, seed), new_object(f"{name} parent")
    wander(parent, seed + 5, 0.2, scale=True)
    hand.parent = parent
    return hand


def in_a_scaled_rig(name: str, seed: int) -> Carrier:
    """Return a hand of a rig as FBX importers leave it: bones in centimetres, and an object scaled to compensate."""
    rig = arm(name, seed)
    wander(rig, seed + 9, 0.2)
    rig.scale = 3 * (0.01,)
    for curve in rig.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        if "Body" in curve.data_path and curve.data_path.endswith("location"):
            for key in curve.keyframe_points:
                key.co_ui.y *= 100.0
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.transform(Matrix.Scale(100.0, 4))
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig.pose.bones["Hand"]


HOLDERS: dict[str, Callable[[str, int], Carrier]] = {
    "FK": by_fk,
    "IK": by_ik,
    "scaled strip": in_a_scaled_strip,
    "object": by_an_object,
    "scaled parent": on_a_scaled_parent,
    "growing parent": on_one_that_grows,
    "scaled rig": in_a_scaled_rig,
}


def free(order: str = "QUATERNION") -> tuple[Carrier, Carrier]:
    return new_object("Tool", order), new_object("Twin", order)


def parented(order: str = "XYZ", scale: float = 1.0) -> tuple[Carrier, Carrier]:
    """Return an object on a moving parent, with a parent inverse."""
    parent, pair = new_object("Table"), free(order)
    wander(parent, 91, 0.2)
    parent.scale = 3 * (scale,)
    for obj in pair:
        obj.parent = parent
        obj.matrix_parent_inverse = (
            Matrix.Translation((0.1, 0.2, -0.1)) @ Quaternion((0.9, 0.1, 0.3, 0.2)).normalized().to_matrix().to_4x4()
        )
    return pair


def on_a_bone(order: str = "QUATERNION") -> tuple[Carrier, Carrier]:
    rig, pair = arm("Holster", 50), free(order)
    for obj in pair:
        obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "Body"
        obj.matrix_parent_inverse = Matrix.Translation((0.1, -0.2, 0.05))
    return pair


def bone(order: str = "QUATERNION", **settings: object) -> tuple[Carrier, Carrier]:
    """Return a bone on a moving bone. `settings` are properties of `bpy.types.Bone`."""
    rig = arm("Quiver", 60)
    wander(rig, 65, 0.2)
    for name in ("Prop", "Twin"):
        for setting, value in settings.items():
            setattr(rig.data.bones[name], setting, value)
    pair = rig.pose.bones["Prop"], rig.pose.bones["Twin"]
    for one in pair:
        one.rotation_mode = order
    return pair


def bone_of_a_scaled_rig() -> tuple[Carrier, Carrier]:
    hand = in_a_scaled_rig("Quiver", 60)
    return hand.id_data.pose.bones["Prop"], hand.id_data.pose.bones["Twin"]


PROPS: dict[str, Callable[[], tuple[Carrier, Carrier]]] = {
    "quaternion": free,
    "Euler": lambda: free("ZXY"),
    "axis angle": lambda: free("AXIS_ANGLE"),
    "parented": parented,
    "on a scaled parent": lambda: parented("QUATERNION", 1.7),
    "on a bone": on_a_bone,
    "bone": bone,
    "Euler bone": lambda: bone("YZX"),
    "axis angle bone": lambda: bone("AXIS_ANGLE"),
    "bone without Inherit Rotation": lambda: bone(use_inherit_rotation=False),
    "bone without Local Location": lambda: bone("XYZ", use_local_location=False),
    "bone of a scaled rig": bone_of_a_scaled_rig,
}
"""Props, and for each a twin that rests at the origin of the space of the prop's channels."""


def units(prop: Carrier) -> float:
    """Return the length of a metre in the units of a prop's channels."""
    return 100.0 if prop != prop.id_data and prop.id_data.scale[0] < 0.1 else 1.0


def place(prop: Carrier, seed: int = 3, reach: float = 0.4, *, frame: float | None = None) -> None:
    """Put a prop at a random place in the space of its channels, and key it if a frame is given."""
    random = np.random.default_rng(seed)
    turn = Quaternion(random.normal(size=4)).normalized()
    prop.matrix_basis = Matrix.LocRotScale(units(prop) * random.uniform(-reach, reach, 3), turn, None)
    if frame is not None:
        for path in ("location", rotation_path(prop)):
            prop.keyframe_insert(path, frame=frame)
    bpy.context.view_layer.update()


def take(prop: Carrier, holder: Carrier | None, frame: float, *, frames: int | None = None, seed: int = 3) -> None:
    """Hold a prop in a hand from a frame on, some centimetres from the hand."""
    bpy.context.scene.frame_set(int(frame))
    hold_in(prop, holder, frames=frames)
    place(prop, seed, 0.05, frame=frame)
