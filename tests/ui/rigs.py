"""A rig in Pose Mode, with keyed bones to act on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from tests.animation.scenes import new_object

NAMES = ("Hip", "Arm", "Hand")
FRAMES = np.array((1.0, 11.0, 21.0, 41.0))


def new_rig(name: str = "Rig", bones: Sequence[str] = NAMES) -> bpy.types.Object:
    """An armature with a chain of bones that lean, each the child of the one before, in Pose Mode."""
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    rig = new_object(name, data=bpy.data.armatures.new(name))
    rig.location = (1.0, 2.0, 3.0)
    rig.rotation_quaternion = (0.8, 0.0, 0.6, 0.0)
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    before = None
    for number, bone_name in enumerate(bones):
        bone = rig.data.edit_bones.new(bone_name)
        bone.head, bone.tail = (0.1 * number, 0.0, float(number)), (0.1 * number, 0.3, number + 0.8)
        bone.roll, bone.parent = 0.3, before
        before = bone
    bpy.ops.object.mode_set(mode="POSE")
    select(rig, ())
    return rig


def key_bone(bone: bpy.types.PoseBone, *, seed: int = 0, paths: Iterable[str] = ("location", "rotation_quaternion")):
    """Key these channels of a bone at random, all of it in a group of its name."""
    random = np.random.default_rng((seed, *map(ord, bone.name)))
    prefix = f'pose.bones["{bone.name}"].'
    for path in paths:
        values = random.normal(size=(len(FRAMES), 4 if path == "rotation_quaternion" else 3))
        if path == "scale":
            values = np.exp(0.3 * np.repeat(values[:, :1], 3, axis=1))
        write_channel(bone.id_data, prefix + path, FRAMES, values)
    return bone


def keyed_rig(name: str = "Rig") -> bpy.types.Object:
    """A rig with keys on all bones, the first of which are selected but for the hip; the hand is the active bone."""
    rig = new_rig(name)
    for bone in rig.pose.bones:
        key_bone(bone)
    select(rig, ("Arm", "Hand"))
    return rig


def select(rig: bpy.types.Object, names: Iterable[str]) -> None:
    """Have these bones of a rig selected, and no others; the last of them is the active one."""
    names = list(names)
    for bone in rig.pose.bones:
        (bone if bpy.app.version >= (5, 0) else bone.bone).select = bone.name in names
    rig.data.bones.active = rig.data.bones[names[-1]] if names else None


def select_keys(bone: bpy.types.PoseBone, *frames: float) -> None:
    """Have these keys of a bone selected, and no others of it."""
    data = bone.id_data.animation_data
    prefix = f'pose.bones["{bone.name}"].'
    for fcurve in data.action.layers[0].strips[0].channelbag(data.action_slot).fcurves:
        if fcurve.data_path.startswith(prefix):
            for key in fcurve.keyframe_points:
                key.select_control_point = key.co.x in frames
