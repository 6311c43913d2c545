"""Armatures with keys on their bones, to be edited and played in tests. Metres, radians, frames of the scene."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from rigid_motion.animation import set_mode
from tests.animation.scenes import key

PLAYED = np.arange(-2.0, 44.0)
"""Frames from before the first key until after the last."""

BETWEEN = np.arange(-2.0, 44.0, 0.375)
"""Frames over the same range in steps through all eighths, whole frames among them."""

ORDERS = ("QUATERNION", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
INHERIT_SCALES = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")


def in_turn(cases: Iterable, others: Sequence) -> list[tuple]:
    """Pair each case with one of the others, which depends on the Blender version; in thorough runs, with about two."""
    # A Blender with a window has no Hypothesis.
    from tests.thoroughness import THOROUGH

    step = max(2, (len(others) + 1) // 2) if THOROUGH else len(others)
    this_blender = 10 * bpy.app.version[0] + bpy.app.version[1]
    pairs = itertools.product(enumerate(cases), enumerate(others))
    return [(case, other) for (i, case), (j, other) in pairs if (i + j + this_blender) % step == 0]


@dataclass(frozen=True)
class Rest:
    """A bone in its rest pose, in armature space. `settings` are properties of `bpy.types.Bone`."""

    name: str
    head: tuple[float, float, float]
    tail: tuple[float, float, float]
    parent: str = ""
    roll: float = 0.0
    settings: tuple[tuple[str, object], ...] = ()


ARM = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Upper", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1),
    Rest("Lower", (0.6, 0.1, 1.3), (0.8, 0.3, 1.2), "Upper", roll=2.0),
    Rest("Hand", (0.82, 0.33, 1.2), (0.9, 0.4, 1.1), "Lower", roll=0.7),
)
"""A body and a chain of three bones."""

HANDS = (
    Rest("Body", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    Rest("Hand.L", (0.5, 0.0, 1.0), (1.0, 0.1, 1.0), "Body", roll=0.3),
    Rest("Hand.R", (-0.5, 0.0, 1.0), (-1.0, 0.1, 1.0), "Body", roll=-0.3),
)
"""A body and two hands that mirror each other."""


def new_rig(
    name: str = "Rig", bones: Sequence[Rest] = ARM, rotation_mode: str = "QUATERNION", **settings: object
) -> bpy.types.Object:
    """Create an armature in the scene. `settings` are properties of the last bone, such as `use_connect`."""
    rig = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(rig)

    def build(edit_bones: bpy.types.ArmatureEditBones) -> None:
        for rest in bones:
            made = edit_bones.new(rest.name)
            made.head, made.tail, made.roll = rest.head, rest.tail, rest.roll
            made.parent = edit_bones[rest.parent] if rest.parent else None
            for setting, value in (dict(rest.settings) | (settings if rest is bones[-1] else {})).items():
                setattr(made, setting, value)

    with_edit_bones(rig, build)
    for pose_bone in rig.pose.bones:
        pose_bone.rotation_mode = rotation_mode
    return rig


def with_edit_bones(rig: bpy.types.Object, edit: Callable[[bpy.types.ArmatureEditBones], None]) -> None:
    """Edit the bones of this rig alone in Edit Mode."""
    select_only(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    edit(rig.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def select_only(*objects: bpy.types.Object) -> None:
    """Select only these objects, and make the first one active."""
    bpy.context.view_layer.update()
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def select_bones(rig: bpy.types.Object, *names: str) -> None:
    """Select only these bones of a rig in Pose Mode, and make the first one active."""
    for bone in rig.pose.bones:
        (bone if bpy.app.version >= (5, 0) else bone.bone).select = bone.name in names
    rig.data.bones.active = rig.data.bones[names[0]] if names else None


def pose_mode(rig: bpy.types.Object, *selected: str) -> bpy.types.Object:
    """Enter Pose Mode with this rig alone, with these bones selected, by default all."""
    select_only(rig)
    bpy.ops.object.mode_set(mode="POSE")
    select_bones(rig, *(selected or rig.pose.bones.keys()))
    return rig


@contextmanager
def own_clipboard(folder: str | Path) -> Iterator[None]:
    """Separate copied poses from those of other Blenders on this machine: they are a file in the temporary folder."""
    filepaths = bpy.context.preferences.filepaths
    before, filepaths.temporary_directory = filepaths.temporary_directory, str(folder)
    try:
        yield
    finally:
        filepaths.temporary_directory = before


def key_all(rig: bpy.types.Object, **settings: object) -> bpy.types.Object:
    """Key every bone at random."""
    for pose_bone in rig.pose.bones:
        key(pose_bone, **settings)
    return rig


def moving_rig(mode: str = "dq_sclerp", name: str = "Rig", seed: int = 0) -> bpy.types.Object:
    """Return the arm with keys on all bones, all in one mode."""
    rig = key_all(new_rig(name), seed=seed)
    set_mode(list(rig.pose.bones), mode)
    return rig
