"""How large things are in a glTF document: what tolerances and radii are judged by, in its unit, which is the metre.

Size is that of joints, which are heads of bones, or of meshes: where bones end is made up by importers.
"""

from __future__ import annotations

import itertools

import numpy as np

from .accessors import numbers
from .documents import Document, Json, entry, objects
from .nodes import Nodes

OF_A_BODY = 0.003
"""The tolerance that the keys of a body are reduced to where none is given, of its size: 5 mm for a grown-up."""

OF_KEY_POSES = 0.02
"""The same for key poses, which are to be few: 35 mm."""

SHELL = 0.03 / 1.7
"""The radius of a joint's ball, of the size of its body: three centimetres of a grown-up."""


def joints_of(document: Document) -> list[list[int]]:
    """Return the nodes that are joints of each skin."""
    skins = [skin["joints"] for skin in objects(document.json, "skins") if isinstance(skin.get("joints"), list)]
    for joint in itertools.chain.from_iterable(skins):
        entry(document.json, "nodes", joint)
    return skins


def size_of(nodes: Nodes, moved: np.ndarray) -> float:
    """Return the largest extent along any axis of what moves, at rest: joints, meshes, or nodes that are neither."""
    document, origins = nodes.document, nodes.resting.origins
    sizes = [float(np.ptp(origins[joints], axis=0).max()) for joints in joints_of(document) if joints]
    if max(sizes, default=0.0) > 0.0:
        return max(sizes)
    boxes = [
        nodes.resting[node].at(corners)
        for node in moved.tolist()
        if (corners := corners_of(document, node)) is not None
    ]
    points = np.concatenate(boxes) if boxes else origins[moved]
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def radii_of(nodes: Nodes, moved: np.ndarray, size: float) -> np.ndarray:
    """Return the radius of the ball around each of these nodes (n,) in which no point is to be off by more, shape (n,).

    Of a mesh it is that of the mesh, of what looks or shines the size of the whole, and of all else a share of it.
    """
    document, result = nodes.document, np.full(len(moved), SHELL * size)
    for row, node in enumerate(moved.tolist()):
        own = document.json["nodes"][node]
        corners = corners_of(document, node)
        if corners is not None:
            away = nodes.resting[node].at(corners) - nodes.resting.origins[node]
            result[row] = np.linalg.norm(away, axis=1).max()
        elif "camera" in own or "KHR_lights_punctual" in own.get("extensions", {}):
            result[row] = size
    return result


def corners_of(document: Document, node: int) -> np.ndarray | None:
    """Return corners of a node's mesh in its own space, shape (8, 3); None without one, or where a skin moves it."""
    own = document.json["nodes"][node]
    if "mesh" not in own or "skin" in own:
        return None
    bounds = [
        box
        for primitive in objects(entry(document.json, "meshes", own["mesh"]), "primitives")
        if (box := _bounds(document, primitive)) is not None
    ]
    if not bounds:
        return None
    low, high = np.min([low for low, _ in bounds], axis=0), np.max([high for _, high in bounds], axis=0)
    return np.array(list(itertools.product(*zip(low, high, strict=True))))


def _bounds(document: Document, primitive: Json) -> tuple[np.ndarray, np.ndarray] | None:
    position = primitive.get("attributes", {}).get("POSITION")
    if position is None:
        return None
    accessor = entry(document.json, "accessors", position)
    if "min" in accessor and "max" in accessor and not accessor.get("normalized"):
        return np.array(accessor["min"], dtype=np.float64), np.array(accessor["max"], dtype=np.float64)
    positions = numbers(document, position)
    return positions.min(axis=0), positions.max(axis=0)
