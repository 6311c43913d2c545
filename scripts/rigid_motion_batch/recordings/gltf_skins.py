"""Skins of glTF files: the surface that the nodes of a body carry at rest, by weights or rigidly.


Source: the glTF 2.0 specification, Khronos 2021, section 3.7.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rigid_motion.gltf.accessors import numbers, raw_numbers
from rigid_motion.gltf.documents import GltfError, Json, entry, objects
from rigid_motion.gltf.nodes import Nodes
from rigid_motion.motion.affine import AffineMaps

from .rest_bodies import MAX_JOINTS_PER_VERTEX, MOST_VERTICES, Skin
from .scene_bodies import with_above

TRIANGLES_MODE = 4
"""The mode of primitives in which every three vertices are a triangle."""

DRACO = "KHR_draco_mesh_compression"


def skin_of(nodes: Nodes, own: Sequence[int], to_blender: np.ndarray) -> Skin | None:
    """Return the surface of a body, or None if it has no triangles or too many vertices.

    Parameters
    ----------
    nodes : Nodes
    own : sequence of int
        The nodes that are joints of the body.
    to_blender : array, shape (3, 3)
        Converts points to the axes of the body.

    Raises
    ------
    GltfError
        For a compressed or damaged mesh.
    """
    rows = {node: joint for joint, node in enumerate(own)}
    parts, before = [], 0
    for primitive, carriers, maps in _carried(nodes, rows):
        part = _primitive_surface(nodes, primitive, carriers, maps)
        parts.append(Skin(part.vertices @ to_blender.T, part.triangles + before, part.joints, part.weights))
        before += len(part.vertices)
        if before > MOST_VERTICES:
            return None
    if not sum(len(part.triangles) for part in parts):
        return None
    return Skin(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])))


def _carried(nodes: Nodes, rows: dict[int, int]) -> Iterator[tuple[Json, np.ndarray, AffineMaps]]:
    """Yield each primitive, the numbers of the joints that carry it (k,), and its transform for each joint (k,)."""
    json = nodes.document.json
    for number, node in enumerate(objects(json, "nodes")):
        if "mesh" not in node:
            continue
        if "skin" in node:
            skin = entry(json, "skins", node["skin"])
            joints, maps = skin["joints"], nodes.resting[skin["joints"]]
            if not any(joint in rows for joint in joints):
                continue
            if "inverseBindMatrices" in skin:
                columns = numbers(nodes.document, skin["inverseBindMatrices"])[: len(joints)]
                inverse = np.swapaxes(columns.reshape(-1, 4, 4), 1, 2)
                maps = maps @ AffineMaps(inverse[:, :3, :3], inverse[:, :3, 3])
        else:
            line = [above for above in with_above(nodes.parents, [number]) if above in rows]
            if not line:
                continue
            joints, maps = line[-1:], nodes.resting[[number]]
        carriers = np.array([rows.get(joint, 0) for joint in joints])
        for primitive in objects(entry(json, "meshes", node["mesh"]), "primitives"):
            if primitive.get("mode", TRIANGLES_MODE) == TRIANGLES_MODE and "POSITION" in primitive["attributes"]:
                yield primitive, carriers, maps


def _primitive_surface(nodes: Nodes, primitive: Json, carriers: np.ndarray, maps: AffineMaps) -> Skin:
    """Return the surface of a primitive, in the axes of the document."""
    document, attributes = nodes.document, primitive["attributes"]
    if DRACO in primitive.get("extensions", {}):
        raise GltfError("it is compressed by Draco", "export it without")
    points = numbers(document, attributes["POSITION"])
    if "indices" in primitive:
        corners = raw_numbers(document, primitive["indices"])[:, 0].astype(np.int64)
    else:
        corners = np.arange(len(points))
    names = [name for name in attributes if name.startswith("JOINTS_")] if len(maps.origins) > 1 else []
    joints, weights = (
        np.zeros((len(points), MAX_JOINTS_PER_VERTEX), dtype=np.int64),
        np.zeros((len(points), MAX_JOINTS_PER_VERTEX)),
    )
    if names:
        given = np.hstack([raw_numbers(document, attributes[name]) for name in names]).astype(np.int64)
        shares = np.hstack([numbers(document, attributes[name.replace("JOINTS", "WEIGHTS")]) for name in names])
        strongest = np.argsort(-shares, axis=1, kind="stable")[:, :MAX_JOINTS_PER_VERTEX]
        joints, weights = (np.take_along_axis(some, strongest, axis=1) for some in (given, shares))
    weights[weights.sum(axis=1) <= 0.0, 0] = 1.0
    weights /= weights.sum(axis=1, keepdims=True)
    placed = maps[joints].at(points[:, None])
    vertices = np.einsum("vk,vki->vi", weights, placed)
    return Skin(vertices, corners[: len(corners) // 3 * 3].reshape(-1, 3), carriers[joints], weights)
