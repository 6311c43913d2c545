"""Bodies for the GLB benchmark: imported by Blender, scaled to one height, avatars with a skin."""

from __future__ import annotations

import itertools
from pathlib import Path

import bpy
import numpy as np

HEIGHT_M = 1.7
"""The height of all bodies, in metres."""

RADIUS_M = 0.03
"""The radius of the shell around joints of a body of that height, in metres; proportional for larger bodies."""

CORNERS = np.array([*itertools.product((-1.0, 1.0), (0.0, 1.0), (-1.0, 1.0))])
BOX_FACES = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
"""Corners and faces of a box; y is along the bone."""

HALF_WIDTH_RATIO = 0.15
"""Half the width of a box, relative to the length of its bone."""

PARENT_WEIGHT = 0.3
"""The weight of a bone's parent, in the vertices at the bone's head."""

SMILE_M, SMILE_PERIOD_S = 0.02, 2.5
"""The distance that the expression moves all vertices, in metres, and its period, in seconds."""


def export(path: Path, output: Path, *, as_avatar: bool) -> None:
    """Import an FBX or BVH file with Blender, scale its body, and export it with a key on every frame."""
    rig = _imported(path, 1.0)
    heads = np.array([rig.matrix_world @ bone.head_local for bone in rig.data.bones])
    rig = _imported(path, HEIGHT_M / float(np.ptp(heads, axis=0).max()))
    ends = [frame for action in bpy.data.actions for frame in action.frame_range]
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = int(min(ends)), int(max(ends))
    if as_avatar:
        _add_skin(rig)
    bpy.ops.export_scene.gltf(filepath=str(output), export_format="GLB")


def _imported(path: Path, scale: float) -> bpy.types.Object:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.suffix.lower() == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(path), global_scale=scale)
    else:
        options = {"use_fps_scale": False, "update_scene_fps": True, "update_scene_duration": True}
        bpy.ops.import_anim.bvh(filepath=str(path), global_scale=scale, **options)
    return next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")


def _add_skin(rig: bpy.types.Object) -> None:
    """Add a skin to a rig, a box around each bone, and an expression with a key on every frame."""
    bones, count = list(rig.data.bones), len(CORNERS)
    boxes = [CORNERS * (HALF_WIDTH_RATIO * bone.length, bone.length, HALF_WIDTH_RATIO * bone.length) for bone in bones]
    rests = [np.array(bone.matrix_local) for bone in bones]
    points = [box @ rest[:3, :3].T + rest[:3, 3] for box, rest in zip(boxes, rests, strict=True)]
    mesh = bpy.data.meshes.new("Skin")
    faces = np.concatenate([BOX_FACES + count * number for number in range(len(bones))])
    mesh.from_pydata(np.concatenate(points).tolist(), [], faces.tolist())
    body = bpy.data.objects.new("Skin", mesh)
    bpy.context.collection.objects.link(body)
    groups = {bone.name: body.vertex_groups.new(name=bone.name) for bone in bones}
    for number, bone in enumerate(bones):
        shares = np.where(CORNERS[:, 1] == 0.0, PARENT_WEIGHT, 0.0) * bool(bone.parent)
        for vertex, share in enumerate(shares.tolist(), count * number):
            groups[bone.name].add([vertex], 1.0 - share, "REPLACE")
            if share:
                groups[bone.parent.name].add([vertex], share, "REPLACE")
    body.parent = rig
    body.modifiers.new("Rig", "ARMATURE").object = rig
    body.shape_key_add(name="Basis")
    smile = body.shape_key_add(name="smile")
    for point in smile.data:
        point.co.x += SMILE_M
    scene = bpy.context.scene
    for frame in range(scene.frame_start, scene.frame_end + 1):
        smile.value = max(0.0, float(np.sin(2.0 * np.pi * frame / (SMILE_PERIOD_S * scene.render.fps))))
        smile.keyframe_insert("value", frame=frame)
