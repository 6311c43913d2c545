"""Sizes of objects and rigs, including everything attached to them, in the scene's units and in those of channels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import cast

import bpy
import numpy as np

from ...blender import pose_bones, scene
from ...gltf.sizes import MIN_BALL_RADIUS_RATIO, OF_A_BODY, OF_KEY_POSES
from . import Transform, transform_of

SOME_SIZE = 0.1
"""The radius, in metres, of an object without a size."""

SAME_PLACE = 0.1
"""A rig whose heads extend over less than this fraction of its longest bone is as large as that bone."""


def reaches_of(rig: bpy.types.Object) -> dict[str, float]:
    """Return the distance that each bone of a rig reaches from its head at rest, in the rig's unit, by bone name.

    It is the largest of the bone's length, the distance of the farthest vertex that it deforms or the farthest corner
    of an object parented to it, and a fraction of the figure's size: three centimetres for an adult.

    Importers invent the lengths of bones without children: such a bone reaches no further than its parent's length, or
    the distance between both heads, if that is more.
    """
    bones = {bone.name: bone for bone in cast(bpy.types.Pose, rig.pose).bones}
    heads = {name: np.array(bone.bone.head_local) for name, bone in bones.items()}
    reaches = {name: _length(bone.bone) or _some_size() for name, bone in bones.items()}
    least = MIN_BALL_RADIUS_RATIO * _extent(rig)
    for obj in cast(bpy.types.Scene, bpy.context.scene).objects:
        if obj.parent == rig and obj.parent_type == "BONE" and obj.parent_bone in bones:
            at_bone = np.array((rig.matrix_world @ bones[obj.parent_bone].matrix).inverted_safe())
            away = {obj.parent_bone: _corners(_evaluated(obj)) @ at_bone[:3, :3].T + at_bone[:3, 3]}
        elif isinstance(obj.data, bpy.types.Mesh) and deforms(rig, obj):
            away = _away_from(heads, obj, np.array(rig.matrix_world.inverted_safe() @ obj.matrix_world))
        else:
            continue
        for name, points in away.items():
            reaches[name] = max(reaches[name], float(np.linalg.norm(points, axis=1).max()))
    return {name: max(reach, least) for name, reach in reaches.items()}


def deforms(rig: bpy.types.Object, obj: bpy.types.Object) -> bool:
    """Return whether a rig deforms an object, by a modifier or as its parent."""
    by_parent = obj.parent == rig and obj.parent_type == "ARMATURE"
    modifiers = (item for item in obj.modifiers if isinstance(item, bpy.types.ArmatureModifier))
    return by_parent or any(item.object == rig for item in modifiers)


def _away_from(heads: Mapping[str, np.ndarray], obj: bpy.types.Object, into_rig: np.ndarray) -> dict[str, np.ndarray]:
    """Return the offsets (n, 3) of the vertices in each bone's group from the bone's head (3,), in the rig's space."""
    vertices = cast(bpy.types.Mesh, obj.data).vertices
    places = np.empty(3 * len(vertices), dtype=np.float32)
    vertices.foreach_get("co", places)
    places = places.reshape(-1, 3) @ into_rig[:3, :3].T + into_rig[:3, 3]
    pairs = [(item.group, number) for number, v in enumerate(vertices) for item in v.groups if item.weight > 0.0]
    groups, numbers = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    named = {group.name: numbers[groups == group.index] for group in obj.vertex_groups if group.name in heads}
    return {name: places[those] - heads[name] for name, those in named.items() if len(those)}


def _length(bone: bpy.types.Bone) -> float:
    parent = bone.parent
    if parent is None or bone.children:
        return bone.length
    return min(bone.length, max((bone.head_local - parent.head_local).length, parent.length))


def drawn_size(obj: bpy.types.Object) -> float:
    """Return the display size of an empty or a camera, 0 for other objects."""
    if isinstance(obj.data, bpy.types.Camera):
        return obj.data.display_size
    return obj.empty_display_size if obj.type == "EMPTY" else 0.0


def _some_size() -> float:
    return SOME_SIZE / metres_per_unit(scene())


def metres_per_unit(scene: bpy.types.Scene) -> float:
    return 1.0 if scene.unit_settings.system == "NONE" else scene.unit_settings.scale_length


def size_of(matrix: object) -> float:
    """Return the uniform scale with the same volume as a matrix."""
    return float(np.cbrt(abs(np.linalg.det(np.array(matrix)[:3, :3]))))


def radius_of(obj: bpy.types.Object | bpy.types.PoseBone) -> float:
    """Return how far an object or a pose bone reaches from its origin, in the scene's units.

    For objects, this is the farthest corner of the current bounding boxes of the object and all its children; for
    bones, the reach at rest (`reaches_of`); for rigs, that of the bones as posed now. Empties and cameras are as large
    as drawn. Anything without a size counts as ten centimetres.
    """
    if isinstance(obj, bpy.types.PoseBone):
        return reaches_of(transform_of(obj).animated)[obj.name] * scale_in_scene(transform_of(obj))
    evaluated = _evaluated(obj)
    world = np.array(evaluated.matrix_world)
    if obj.pose is not None and len(obj.pose.bones):
        heads = np.array([bone.head for bone in pose_bones(evaluated)]) @ world[:3, :3].T
        reaches = np.array(list(reaches_of(obj).values())) * size_of(world)
        return float((np.linalg.norm(heads, axis=1) + reaches).max()) or _some_size()
    corners = np.concatenate([_corners(_evaluated(item)) for item in (obj, *obj.children_recursive)])
    reach = float(np.linalg.norm(corners - world[:3, 3], axis=1).max())
    return max(reach, drawn_size(obj) * size_of(world)) or _some_size()


def _corners(evaluated: bpy.types.Object) -> np.ndarray:
    """Return the corners of an object's bounding box in the world, (8, 3): its origin if it has no size."""
    world = np.array(evaluated.matrix_world)
    return np.array(evaluated.bound_box) @ world[:3, :3].T + world[:3, 3]


def rig_size(rig: bpy.types.Object) -> float:
    """Return the size of a rig in the scene's units: the largest extent of its joints along any of its axes, at rest.

    Joints are the heads of bones, as importers invent the tails of the last bones. If all heads are in one place, a rig
    is as large as its longest bone.
    """
    return _extent(rig) * size_of(_evaluated(rig).matrix_world)


def _extent(rig: bpy.types.Object) -> float:
    bones = [bone.bone for bone in pose_bones(rig)]
    reach = max((_length(bone) or _some_size() for bone in bones), default=0.0)
    extent = float(np.ptp(np.array([bone.head_local for bone in bones]), axis=0).max()) if bones else 0.0
    return extent if extent > SAME_PLACE * reach else reach


def first_tolerance(scene: bpy.types.Scene, targets: Iterable[Transform], *, shared: bool = False) -> float:
    """Return the initial tolerance, in the scene's units: a millimetre, or for rigs a fraction of their size.

    The fraction is larger if the bones share key poses.
    """
    sizes = [rig_size(rig) for rig in {target.animated for target in targets if target.is_part}]
    if not sizes or max(sizes) <= 0.0:
        return 0.001 / metres_per_unit(scene)
    return float(f"{(OF_KEY_POSES if shared else OF_A_BODY) * max(sizes):.2g}")


def _evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def scale_in_scene(transform: Transform) -> float:
    """Return the current scale of a transform's data-block in the scene, 1 if it is zero."""
    return size_of(_evaluated(transform.animated).matrix_world) or 1.0


def into_scene(transform: Transform) -> np.ndarray:
    """Return the matrix (3, 3) from the axes of an object's channels to those of the scene, with its parents now."""
    obj = transform.animated
    if obj.parent is None and not obj.constraints:
        return np.eye(3)
    basis, world = np.array(obj.matrix_basis.to_3x3()), np.array(_evaluated(obj).matrix_world.to_3x3())
    if not (size_of(basis) > 0.0 and size_of(world) > 0.0):
        return np.eye(3)
    # Constraints may rotate it in any way: then only the scale counts.
    return np.eye(3) * size_of(world) / size_of(basis) if obj.constraints else world @ np.linalg.inv(basis)
