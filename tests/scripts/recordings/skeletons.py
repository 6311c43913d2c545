"""A small moving body with a skin, made in the open scene and exported as FBX, glTF and .blend."""

import contextlib
import io
import warnings
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.silencing import silenced
from tests.blank import blank
from tests.scripts.recordings.blends import added, bones_in_blender, in_blender, key, rig

bpy = pytest.importorskip("bpy")

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
