"""Scenes with keyed objects, rigs and a small body with a skin, saved as .blend and exported as FBX and glTF."""

import contextlib
import io
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import Trajectory
from rigid_motion_batch.silencing import silenced
from tests.blank import blank

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


BONES = {
    "Root": ((0, 0, 0), (0, 0, 0.3), None),
    "Upper": ((0, 0, 0.3), (0, 0, 1), "Root"),
    "Lower": ((0, 0, 1), (0.3, 0, 1.7), "Upper"),
    "Hand": ((0.3, 0, 1.7), (0.6, 0.2, 1.8), "Lower"),
    "Lever": ((0, 1, 0), (0, 1.2, 0), "Root"),
}
"""Heads, tails and parents of bones. The lever deforms nothing."""

CARRYING = ("Root", "Upper", "Lower", "Hand")

FRAMES = range(1, 21)

TRIANGLES = [(0, 1, 2), (1, 2, 3)]

UNEVEN = (1.2, 1.0, 0.8)
"""An uneven object scale, which shears rotated children."""


def body(name: str = "Body", fps: int = 24, size: tuple[float, float, float] = UNEVEN) -> bpy.types.Object:
    """Add a moved, turned and scaled armature with keys on each of `FRAMES`."""
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = fps, FRAMES[0], FRAMES[-1]
    obj = rig(name, BONES)
    obj.data.bones["Lever"].use_deform = False
    obj.rotation_mode, obj.scale = "QUATERNION", size
    animate(obj)
    return obj


def animate(obj: bpy.types.Object, swing: float = 0.3) -> None:
    for frame in FRAMES:
        half = 0.02 * frame
        key(obj, frame, location=(0.01 * frame, 0.1, 0.2), rotation_quaternion=(np.cos(half), 0, 0, np.sin(half)))
        for number, bone in enumerate(obj.pose.bones):
            key(bone, frame, rotation_euler=(swing * np.sin(0.1 * frame + number), 0.005 * number * frame, 0.2))
    bpy.context.scene.frame_set(FRAMES[0])


def skinned(obj: bpy.types.Object) -> bpy.types.Object:
    """Add a mesh of four vertices deformed by an armature, each with a weight of three quarters on one bone."""
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata([(0, 0, 0), (0.1, 0, 1), (0, 0.1, 1.5), (0.6, 0.2, 1.8)], [], TRIANGLES)
    skin = added("Skin", mesh, parent=obj)
    skin.modifiers.new("Armature", "ARMATURE").object = obj
    for number, name in enumerate(CARRYING):
        group = skin.vertex_groups.new(name=name)
        group.add([number], 0.75, "REPLACE")
        group.add([(number + 1) % len(CARRYING)], 0.25, "REPLACE")
    return skin


def places_in_blender(obj: bpy.types.Object) -> np.ndarray:
    """Return the head positions of the deforming bones on `FRAMES`, shape (bones, frames, 3)."""
    return bones_in_blender(obj, CARRYING, FRAMES)[..., :3, 3]


def surface_in_blender(skin: bpy.types.Object) -> np.ndarray:
    """Return the vertex positions of a mesh in the open scene on `FRAMES`, shape (vertices, frames, 3)."""

    def show(depsgraph: bpy.types.Depsgraph) -> list:
        shown = skin.evaluated_get(depsgraph)
        return [shown.matrix_world @ vertex.co for vertex in shown.data.vertices]

    return in_blender(FRAMES, show)


def export(path: Path, **settings: object) -> Path:
    """Export or save the open scene in the format of a path's ending, then clear the scene."""
    with silenced(), contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if path.suffix == ".fbx":
            settings = {"add_leaf_bones": False, "bake_anim_simplify_factor": 0.0} | settings
            bpy.ops.export_scene.fbx(filepath=str(path), **settings)
        elif path.suffix == ".blend":
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
        else:
            kind = "GLB" if path.suffix == ".glb" else "GLTF_SEPARATE"
            bpy.ops.export_scene.gltf(filepath=str(path), export_format=kind, **settings)
    blank()
    return path
