"""The surface that an armature carries, of all of its meshes together, where its bones are at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion_batch.recordings.rest_bodies import Skin

if TYPE_CHECKING:
    import bpy

MOST_VERTICES = 200_000
"""A body with more is shown without its skin."""

CARRIERS = 4
"""Joints that carry a vertex; more are left out, the weaker ones."""


def carried_by(rig: bpy.types.Object) -> list[bpy.types.Object]:
    """Return the mesh objects that an armature deforms; none where their vertices are too many."""
    import bpy

    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.data and _deforms(rig, obj)]
    return meshes if sum(len(_mesh_of(obj).vertices) for obj in meshes) <= MOST_VERTICES else []


def _mesh_of(obj: bpy.types.Object) -> bpy.types.Mesh:
    return cast("bpy.types.Mesh", obj.data)


def _deforms(rig: bpy.types.Object, obj: bpy.types.Object) -> bool:
    by_parent = obj.parent == rig and obj.parent_type == "ARMATURE"
    deforming = (
        cast("bpy.types.ArmatureModifier", modifier) for modifier in obj.modifiers if modifier.type == "ARMATURE"
    )
    return by_parent or any(item.object == rig for item in deforming)


def skin_of(
    meshes: Sequence[bpy.types.Object], joints: Sequence[str], matrices: Mapping[bpy.types.Object, np.ndarray]
) -> Skin | None:
    """Return the skin of some mesh objects, or None where there are no triangles.

    Parameters
    ----------
    meshes : sequence of bpy.types.Object
    joints : sequence of str
        The bones: what is in no vertex group of theirs is carried by the first.
    matrices : mapping of bpy.types.Object to array, shape (4, 4)
        Where each mesh object is in the world.
    """
    numbers = {name: number for number, name in enumerate(joints)}
    vertices, triangles, carriers, weights, before = [], [], [], [], 0
    for obj in meshes:
        mesh, there = _mesh_of(obj), matrices[obj]
        places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        vertices.append(places.reshape(-1, 3).astype(np.float64) @ there[:3, :3].T + there[:3, 3])
        triangles.append(corners.reshape(-1, 3).astype(np.int64) + before)
        own = _carriers(mesh, [numbers.get(group.name, -1) for group in obj.vertex_groups])
        carriers.append(own[0])
        weights.append(own[1])
        before += len(mesh.vertices)
    if not sum(map(len, triangles)):
        return None
    return Skin(*map(np.concatenate, (vertices, triangles, carriers, weights)))


def _carriers(mesh: bpy.types.Mesh, joint_of_group: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the joints (vertices, 4) that carry each vertex most, and by how much of it."""
    # Blender has no way to hand out all weights at once.
    entries = [
        (vertex.index, joint_of_group[group.group], group.weight)
        for vertex in mesh.vertices
        for group in vertex.groups
        if group.group < len(joint_of_group) and joint_of_group[group.group] >= 0 and group.weight > 0.0
    ]
    joints, weights = np.zeros((len(mesh.vertices), CARRIERS), dtype=np.int64), np.zeros((len(mesh.vertices), CARRIERS))
    if entries:
        owners, carriers, shares = (np.array(column) for column in zip(*entries, strict=True))
        order = np.lexsort((-shares, owners))
        owners, carriers, shares = owners[order], carriers[order], shares[order]
        rank = np.arange(len(owners)) - np.searchsorted(owners, owners)
        strong = rank < CARRIERS
        joints[owners[strong], rank[strong]] = carriers[strong]
        weights[owners[strong], rank[strong]] = shares[strong]
    alone = weights.sum(axis=1) == 0.0
    weights[alone, 0] = 1.0
    return joints, weights / weights.sum(axis=1, keepdims=True)
