"""The node tree of a glTF document: hierarchy, rest transforms, and world transforms under tracks.

Arrays have the nodes first. Quaternions are w, x, y, z.
Source: the glTF 2.0 specification, Khronos 2021, section 3.5.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..motion import Skeleton
from ..motion.affine import AffineMaps
from ..motion.quaternions import matrices, normalise
from .documents import Document, GltfError, Json, entry, objects, shown
from .tracks import LINEAR, MAX_NUMBER, NUMBERS_PER_KEY, ROTATION, SCALE, TO_WXYZ, TRANSLATION, Track, Tracks

REST_VALUES = {TRANSLATION: (0.0, 0.0, 0.0), ROTATION: (0.0, 0.0, 0.0, 1.0), SCALE: (1.0, 1.0, 1.0)}
"""Defaults of glTF, rotation as x, y, z, w."""

MAX_NODE_DEPTH = 1000
"""Most ancestors of a node."""


class Nodes:
    """The nodes of a document.

    Raises
    ------
    GltfError
        For cycles, nodes with two parents, and invalid transforms.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        nodes = objects(document.json, "nodes")
        self.parents = _parents(nodes)
        self.rest = {path: _rest_values(nodes, path) for path in NUMBERS_PER_KEY}
        """Translation (nodes, 3), rotation (nodes, 4) and scale (nodes, 3)."""
        self.matrices = {
            number: _matrix(node["matrix"], number) for number, node in enumerate(nodes) if "matrix" in node
        }
        """Matrices (4, 4) of nodes that have one instead."""

    @cached_property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.parents)

    def rest_of(self, node: int, path: str) -> np.ndarray:
        """Return the value that a track of the node replaces, shape (width,)."""
        if path in self.rest:
            return self.rest[path][node]
        described = self.document.json["nodes"][node]
        mesh = entry(self.document.json, "meshes", described["mesh"]) if "mesh" in described else {}
        targets = max((len(objects(part, "targets")) for part in objects(mesh, "primitives")), default=0)
        return np.array(described.get("weights") or mesh.get("weights") or [0.0] * targets, dtype=np.float64)

    def with_rest(self, path: str, values: np.ndarray) -> Nodes:
        """Return the same nodes with other translations, rotations or scales at rest (nodes, width)."""
        result = copy.copy(self)
        result.__dict__.pop("resting", None)
        result.rest = {**self.rest, path: values}
        return result

    def below(self, moved: np.ndarray) -> np.ndarray:
        """Return these nodes (m,) and all of their descendants, parents before children, shape (n,)."""
        moves = np.zeros(len(self.parents), dtype=bool)
        moves[moved] = True
        for nodes in self.skeleton.levels[1:]:
            moves[nodes] |= moves[self.parents[nodes]]
        return np.concatenate([nodes[moves[nodes]] for nodes in self.skeleton.levels])

    @cached_property
    def resting(self) -> AffineMaps:
        """World transforms of all nodes without tracks, shape (nodes,)."""
        nodes = np.concatenate(self.skeleton.levels)
        return self.worlds(nodes, {}, np.zeros(1))[np.argsort(nodes), 0]

    def worlds(self, nodes: np.ndarray, tracks: Tracks, times: np.ndarray) -> AffineMaps:
        """Return the world transforms of nodes at times (m,), shape (nodes, m).

        `nodes` (n,) has parents before children; a parent that is not in it is at rest.
        """
        seen: dict[int, AffineMaps] = {}
        result = AffineMaps(np.empty((len(nodes), len(times), 3, 3)), np.empty((len(nodes), len(times), 3)))
        for row, node in enumerate(nodes.tolist()):
            parent, local = int(self.parents[node]), self._local(node, tracks, times)
            above = seen[parent] if parent in seen else self.resting[parent] if parent >= 0 else None
            result[row] = seen[node] = local if above is None else above @ local
        return result

    def channel(self, node: int, path: str, tracks: Tracks, times: np.ndarray) -> np.ndarray:
        """Return a node's values at times (m,), shape (m, width), or (1, width) if they are constant."""
        if (node, path) not in tracks:
            return self.rest[path][None, node]
        track = tracks[node, path]
        return track.at(times[:1] if len(track.times) == 1 else times)

    def _local(self, node: int, tracks: Tracks, times: np.ndarray) -> AffineMaps:
        """Return the transforms in the parent's space, shape (m,), or (1,) if they are constant."""
        if node in self.matrices:
            matrix = self.matrices[node][None]
            return AffineMaps(matrix[:, :3, :3], matrix[:, :3, 3])
        translation, rotation, scale = (self.channel(node, path, tracks, times) for path in NUMBERS_PER_KEY)
        axes = np.moveaxis(matrices(rotation), -1, 0) * scale[:, None, :]
        return AffineMaps(axes, translation)


def by_target(tracks: tuple[Track, ...]) -> Tracks:
    return {(track.node, track.path): track for track in tracks}


def steadied(tracks: tuple[Track, ...]) -> Tracks:
    """Return the tracks by node and path; constant tracks get a single key."""
    kept = [
        replace(track, times=track.times[[0]], values=track.points[[0]], interpolation=LINEAR)
        for track in tracks
        if track.is_constant
    ]
    return {**by_target(tracks), **by_target(tuple(kept))}


def _parents(nodes: list[Json]) -> np.ndarray:
    parents = np.full(len(nodes), -1, dtype=np.int64)
    for number, node in enumerate(nodes):
        children = node.get("children", [])
        if not isinstance(children, list):
            raise GltfError(f"the children of node {number} are no list")
        for child in children:
            entry({"nodes": nodes}, "nodes", child)
            if parents[child] >= 0:
                raise GltfError(f"node {child} hangs on nodes {parents[child]} and {number}")
            parents[child] = number
    try:
        deepest = Skeleton(parents).depths.max() if len(nodes) else 0
    except ValueError as error:
        raise GltfError(str(error).replace("joint", "node")) from None
    if deepest > MAX_NODE_DEPTH:
        raise GltfError(f"more than {MAX_NODE_DEPTH} nodes hang on one another", "export a shorter chain")
    return parents


def _rest_values(nodes: list[Json], path: str) -> np.ndarray:
    rows = [_vector(node.get(path, REST_VALUES[path]), number, path) for number, node in enumerate(nodes)]
    result = np.array(rows, dtype=np.float64).reshape(len(nodes), NUMBERS_PER_KEY[path])
    if path != ROTATION:
        return result
    lengths = np.linalg.norm(result, axis=1)
    if not lengths.all():
        raise GltfError(f"the rotation of node {int(np.argmin(lengths))} is of length zero")
    return normalise(result[:, TO_WXYZ])


def _vector(given: object, node: int, name: str, width: int | None = None) -> list[float]:
    width = width or NUMBERS_PER_KEY[name]
    numbers = given if isinstance(given, (list, tuple)) else ()
    if len(numbers) != width or not all(
        isinstance(number, (int, float)) and abs(number) < MAX_NUMBER for number in numbers
    ):
        raise GltfError(f"the {name} of node {node} is {shown(given)}, and not {width} numbers")
    return list(numbers)


def _matrix(given: object, node: int) -> np.ndarray:
    return np.array(_vector(given, node, "matrix", 16), dtype=np.float64).reshape(4, 4).T
