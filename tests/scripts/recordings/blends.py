"""Scenes with keyed objects and rigs, for tests that save and read .blend files."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion_batch.recordings import Trajectory

bpy = pytest.importorskip("bpy")
anim_utils = pytest.importorskip("bpy_extras.anim_utils")

FPS = 50


def added(name: str, data: bpy.types.ID | None = None, **settings: object) -> bpy.types.Object:
    """Add an object to the open scene, an empty if it has no data."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    for setting, value in settings.items():
        setattr(obj, setting, value)
    return obj


def rig(name: str, bones: Mapping[str, tuple[Sequence[float], Sequence[float], str | None]]) -> bpy.types.Object:
    """Add an armature object to the open scene; bones are given by head, tail, and the name of the parent or None."""
    obj = added(name, bpy.data.armatures.new(name))
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    for bone_name, (head, tail, parent) in bones.items():
        bone = obj.data.edit_bones.new(bone_name)
        bone.head, bone.tail = head, tail
        bone.parent = obj.data.edit_bones[parent] if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    for pose_bone in obj.pose.bones:
        pose_bone.rotation_mode = "XYZ"
    return obj


def key(animated: bpy.types.Object | bpy.types.PoseBone, frame: float, **channels: object) -> None:
    """Set channels and key them."""
    for channel, value in channels.items():
        setattr(animated, channel, value)
        animated.keyframe_insert(channel, frame=frame)


def fcurves(obj: bpy.types.Object) -> bpy.types.ActionChannelbagFCurves:
    """Return the F-curves of an object's Action."""
    data = obj.animation_data
    return anim_utils.action_get_channelbag_for_slot(data.action, data.action_slot).fcurves


def linear(obj: bpy.types.Object) -> None:
    """Set all keys of an object's Action to linear interpolation."""
    for fcurve in fcurves(obj):
        for point in fcurve.keyframe_points:
            point.interpolation = "LINEAR"


def in_blender(frames: Iterable[float], show: Callable[[bpy.types.Depsgraph], list]) -> np.ndarray:
    """Return what a function finds in the open scene on some frames, shape (things, frames, ...)."""
    seen = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        seen.append(np.array(show(bpy.context.evaluated_depsgraph_get())))
    return np.array(seen).swapaxes(0, 1)


def bones_in_blender(obj: bpy.types.Object, bones: Sequence[str], frames: Iterable[float]) -> np.ndarray:
    """Return the matrices of bones in the world on some frames, shape (bones, frames, 4, 4)."""

    def show(depsgraph: bpy.types.Depsgraph) -> list:
        shown = obj.evaluated_get(depsgraph)
        return [shown.matrix_world @ shown.pose.bones[name].matrix for name in bones]

    return in_blender(frames, show)


def on_frames(trajectory: Trajectory) -> Trajectory:
    """Return a trajectory without the samples between whole frames."""
    frames = trajectory.times * trajectory.rate
    rows = np.abs(frames - np.rint(frames)) < 1e-6
    return replace(trajectory, times=trajectory.times[rows], poses=trajectory.poses[..., rows])
