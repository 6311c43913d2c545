"""Geometry that the nodes of a glTF document carry: its extent around each node, and displacement by morph targets.

A node carries its mesh and instances; a joint carries all vertices of skins with a weight for it. For compressed meshes
the bounds of their accessors count, and any joint may carry the whole mesh. Lengths are in the document's unit, which
glTF defines as the metre, and in the node's own space, before its scale, unless said otherwise.
Source: the glTF 2.0 specification, Khronos 2021, sections 3.7 and 3.8; EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..motion.affine import AffineMaps
from ..motion.quaternions import matrices, normalise
from .accessors import ALL_ROWS, COMPRESSIONS, NUMBER_TYPES, denormalised, numbers, raw_numbers
from .documents import Document, GltfError, Json, entry, objects
from .nodes import Nodes
from .references import INSTANCING_EXTENSION
from .tracks import CUBICSPLINE, TO_WXYZ, WEIGHTS, Clip, Track

MAX_CUBIC_OVERSHOOT = 4.0 / 27.0
"""Largest overshoot of a cubic beyond its end values, for a tangent of 1 at one end."""


@dataclass(frozen=True, eq=False)
class Morph:
    """How far the morph targets of a node's mesh move its vertices."""

    deltas: np.ndarray
    """Largest displacement of any vertex by a weight of 1, in the space of the mesh, shape (targets,)."""

    carriers: np.ndarray
    """The nodes that carry the vertices, shape (c,)."""

    factors: np.ndarray
    """Scale factors of the mesh in the spaces of the carriers, shape (c,)."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The geometry that the nodes of a document carry."""

    reaches: np.ndarray
    """Distance of the farthest vertex carried by each node from its origin, shape (nodes,); 0 without vertices."""

    boxes: np.ndarray
    """Lowest and highest coordinates of carried vertices, without morph targets, shape (2, nodes, 3); else infinite."""

    morphs: dict[int, Morph]
    """Morph targets by node."""

    @classmethod
    def of(cls, nodes: Nodes, clips: Iterable[Clip]) -> Seen:
        """Return the geometry of nodes, with morph targets as far as any of these clips moves them."""
        document, count = nodes.document, len(nodes.parents)
        boxes = np.full((2, count, 3), np.inf)
        boxes[1] = -np.inf
        result = cls(np.zeros(count), boxes, {})
        tracks = [track for clip in clips for track in clip.all_tracks if track.path == WEIGHTS]
        alike: dict[tuple[int, bytes], int] = {}
        for number, node in enumerate(objects(document.json, "nodes")):
            if "mesh" in node:
                weights = _largest_weights(nodes, number, [track for track in tracks if track.node == number])
                is_plain = "skin" not in node and not _has_instances(node)
                first = alike.setdefault((node["mesh"], weights.tobytes()), number) if is_plain else number
                if first == number:
                    result.add(document, number, weights)
                else:
                    result.add_alike(number, first)
        return result

    def add(self, document: Document, number: int, weights: np.ndarray) -> None:
        """Add the mesh of a node, with these largest weights (targets,) of its morph targets."""
        node, deltas = document.json["nodes"][number], np.zeros(len(weights))
        factors: dict[int, float] = {}
        primitives = objects(entry(document.json, "meshes", node["mesh"]), "primitives")
        # Primitives of several materials often share the vertices of all materials.
        for primitive in {str((own.get("attributes"), own.get("targets"))): own for own in primitives}.values():
            if "POSITION" not in primitive.get("attributes", {}):
                continue
            points = _points(document, primitive["attributes"]["POSITION"])
            spread = np.zeros(len(points))
            for target, moved in enumerate(objects(primitive, "targets")[: len(weights)]):
                if "POSITION" in moved:
                    lengths = np.linalg.norm(_points(document, moved["POSITION"]), axis=1)
                    deltas[target] = max(float(deltas[target]), float(np.max(lengths)))
                    spread += weights[target] * (lengths if len(lengths) == len(spread) else np.max(lengths))
            if _has_instances(node):
                points, spread = corners_of(points.min(axis=0), points.max(axis=0)), np.full(8, np.max(spread))
            for carrier, some, maps in _carried(document, number, primitive):
                larger = float(np.linalg.norm(maps.axes, ord=2, axis=(-2, -1)).max())
                factors[carrier] = max(factors.get(carrier, 0.0), larger)
                own = maps.at(points[some])
                reach = float(np.max(np.linalg.norm(own, axis=-1) + larger * spread[some]))
                self.reaches[carrier] = max(float(self.reaches[carrier]), reach)
                self.boxes[0, carrier] = np.minimum(self.boxes[0, carrier], own.min(axis=(0, 1)))
                self.boxes[1, carrier] = np.maximum(self.boxes[1, carrier], own.max(axis=(0, 1)))
        if deltas.any() and factors:
            self.morphs[number] = Morph(deltas, np.array([*factors]), np.array([*factors.values()]))

    def add_alike(self, number: int, first: int) -> None:
        """Add the geometry of another node with the same mesh to a node."""
        self.reaches[number], self.boxes[:, number] = self.reaches[first], self.boxes[:, first]
        if first in self.morphs:
            self.morphs[number] = replace(self.morphs[first], carriers=np.array([number]))

    def is_same(self, other: Seen) -> bool:
        """Whether the nodes of another document carry the same geometry, number by number."""
        mine, theirs = (
            [some.reaches, some.boxes, *(array for morph in some.morphs.values() for array in vars(morph).values())]
            for some in (self, other)
        )
        return len(mine) == len(theirs) and all(map(np.array_equal, mine, theirs))


def corners_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners of a box, shape (8, 3)."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))))


def _largest_weights(nodes: Nodes, number: int, tracks: list[Track]) -> np.ndarray:
    """Return the largest weights of a node's morph targets, shape (targets,)."""
    result = np.abs(nodes.rest_of(number, WEIGHTS))
    for track in tracks:
        values = np.abs(track.points)
        if values.shape[1] != len(result):
            raise GltfError(f"{values.shape[1]} weights do not fit the {len(result)} morph targets of node {number}")
        result = np.maximum(result, values.max(axis=0))
        if track.interpolation == CUBICSPLINE:
            gaps, tangents = np.diff(track.times)[:, None], np.abs(track.values[:])
            beyond = MAX_CUBIC_OVERSHOOT * gaps * (tangents[:-1, 2] + tangents[1:, 0])
            result = np.maximum(result, (np.maximum(values[:-1], values[1:]) + beyond).max(axis=0))
    return result


def _carried(document: Document, number: int, primitive: Json) -> Iterator[tuple[int, Any, AffineMaps]]:
    """Yield the carriers of vertices of a node's mesh: node, indices of the vertices, and maps from mesh to node.

    The maps have shape (1, 1), or (instances, 1).
    """
    node = document.json["nodes"][number]
    if "skin" not in node:
        yield number, ALL_ROWS, _instances(document, node)
        return
    skin = entry(document.json, "skins", node["skin"])
    joints = np.array(skin["joints"], dtype=np.int64)
    inverse = np.tile(np.eye(4), (len(joints), 1, 1))
    if "inverseBindMatrices" in skin:
        columns = numbers(document, skin["inverseBindMatrices"])[: len(joints)]
        inverse = np.swapaxes(columns.reshape(-1, 4, 4), 1, 2)
    maps, attributes = AffineMaps(inverse[:, :3, :3], inverse[:, :3, 3]), primitive["attributes"]
    names = [name for name in attributes if name.startswith("JOINTS_")]
    if any(_is_compressed(document, attributes[name]) for name in names):
        # Any joint may carry the whole mesh.
        yield from ((joint, ALL_ROWS, maps[[row], None]) for row, joint in enumerate(joints.tolist()))
    elif names:
        of_joints = np.hstack([raw_numbers(document, attributes[name]) for name in names]).astype(np.int64)
        shares = np.hstack([numbers(document, attributes[name.replace("JOINTS", "WEIGHTS")]) for name in names])
        shares[~shares.any(axis=1), 0] = 1.0  # Vertices without weights go with their first joint.
        vertices, columns = np.nonzero(shares)
        rows = of_joints[vertices, columns]
        order = np.argsort(rows, kind="stable")
        used, firsts = np.unique(rows[order], return_index=True)
        for row, some in zip(used.tolist(), np.split(vertices[order], firsts[1:]), strict=True):
            yield int(joints[row]), some, maps[[row], None]


def _has_instances(node: Json) -> bool:
    return isinstance(node.get("extensions"), dict) and INSTANCING_EXTENSION in node["extensions"]


def _instances(document: Document, node: Json) -> AffineMaps:
    """Return the transforms of instances of a node's mesh in its space, shape (instances, 1); identity without any."""
    attributes = node["extensions"][INSTANCING_EXTENSION]["attributes"] if _has_instances(node) else {}
    given = {name: numbers(document, accessor) for name, accessor in attributes.items() if not name.startswith("_")}
    count = max(map(len, given.values()), default=1)
    axes = np.tile(np.eye(3), (count, 1, 1))
    if "ROTATION" in given:
        axes = np.moveaxis(matrices(normalise(given["ROTATION"][:, TO_WXYZ])), -1, 0)
    axes = axes * given.get("SCALE", np.ones((count, 3)))[:, None]
    return AffineMaps(axes, given.get("TRANSLATION", np.zeros((count, 3))))[:, None]


def _is_compressed(document: Document, accessor: object) -> bool:
    """Whether the numbers of a mesh accessor cannot be read because Draco or meshopt compressed them."""
    described = entry(document.json, "accessors", accessor)
    if "bufferView" not in described:
        return "sparse" not in described
    extensions = entry(document.json, "bufferViews", described["bufferView"]).get("extensions")
    return isinstance(extensions, dict) and not extensions.keys().isdisjoint(COMPRESSIONS)


def _points(document: Document, accessor: object) -> np.ndarray:
    """Return the vectors of an accessor, shape (v, 3), or the corners of their bounds if they are compressed."""
    described = entry(document.json, "accessors", accessor)
    if not _is_compressed(document, accessor) or "min" not in described or "max" not in described:
        return numbers(document, accessor)
    ends = np.array([described["min"], described["max"]], dtype=np.float64)
    if described.get("normalized") is True:
        ends = denormalised(ends.astype(NUMBER_TYPES[described["componentType"]]))
    return corners_of(*ends)
