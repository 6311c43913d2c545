"""How far vertices of skins are off: measured, where what is promised is of points around joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .accessors import denormalised, numbers, raw_numbers
from .documents import Document, GltfError, Json, entry, objects
from .errors import World
from .tracks import Tracks

DRACO = "KHR_draco_mesh_compression"

AT_ONCE = 2**18
"""Vertices at moments that are looked at in one go."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The vertices of a primitive, and the joints that carry them."""

    joints: np.ndarray
    """Numbers of nodes, shape (j,)."""

    inverse: np.ndarray
    """From the space of the mesh to those of the joints, shape (j, 4, 4)."""

    vertices: np.ndarray
    """In homogeneous coordinates, shape (v, 4)."""

    carriers: np.ndarray
    """Which of the joints carry each vertex, shape (v, k)."""

    shares: np.ndarray
    """How much of it each carries, shape (v, k). They sum to 1."""


def largest_displacement(world: World, shown: Tracks) -> float | None:
    """Return the largest displacement of any vertex at the moments of a world; None without a skin that can be read."""
    result = None
    for skin in _skins(world.nodes.document):
        result = max(result or 0.0, _of_skin(world, shown, skin, result or 0.0))
    return result


def _of_skin(world: World, shown: Tracks, skin: Skin, least: float) -> float:
    rows = np.array([world.rows.get(node, -1) for node in skin.joints.tolist()])
    moves = rows >= 0
    for block in world.seen(shown, world.truth):
        differences = np.zeros((len(rows), len(block.times), 3, 4))
        for maps, sign in zip(block.maps, (1.0, -1.0), strict=True):
            own = maps[rows[moves]]
            differences[moves] += sign * np.concatenate((own.axes, own.origins[..., None]), axis=-1)
        least = _largest(np.einsum("jmab,jbc->jmac", differences, skin.inverse), skin, least)
    return least


def _largest(differences: np.ndarray, skin: Skin, least: float) -> float:
    """Return the largest displacement of any vertex by joints so far off (j, m, 3, 4), or `least` if that is more."""
    bounds = _bounds(differences, skin)
    order, step = np.argsort(-bounds), max(1, AT_ONCE // len(skin.vertices))
    for first in range(0, len(order), step):
        moments = order[first : first + step]
        if bounds[moments[0]] <= least:
            break
        moved = np.zeros((len(moments), len(skin.vertices), 3))
        for carriers, shares in zip(skin.carriers.T, skin.shares.T, strict=True):
            own = differences[carriers[None], moments[:, None]]
            moved += shares[:, None] * np.einsum("mvab,vb->mva", own, skin.vertices)
        least = max(least, float(np.max(np.linalg.norm(moved, axis=-1))))
    return least


def _bounds(differences: np.ndarray, skin: Skin) -> np.ndarray:
    """Return what no vertex is moved by more than at each moment (m,): corners of the box around those of a joint."""
    result = np.zeros(differences.shape[1])
    for joint, own in enumerate(differences):
        carried = skin.vertices[((skin.carriers == joint) & (skin.shares > 0.0)).any(axis=1)]
        if len(carried) and own.any():
            ends = np.stack((carried.min(axis=0), carried.max(axis=0)))
            corners = np.stack([ends[list(pick), [0, 1, 2, 3]] for pick in np.ndindex(2, 2, 2, 1)])
            result = np.maximum(result, np.linalg.norm(np.einsum("mab,cb->mca", own, corners), axis=-1).max(axis=1))
    return result


def _skins(document: Document) -> Iterator[Skin]:
    """Yield the primitives that skins carry, but for those that are compressed."""
    for node in objects(document.json, "nodes"):
        if "mesh" in node and "skin" in node:
            given = entry(document.json, "skins", node["skin"])
            joints = np.array(given["joints"], dtype=np.int64)
            inverse = np.tile(np.eye(4), (len(joints), 1, 1))
            if "inverseBindMatrices" in given:
                columns = numbers(document, given["inverseBindMatrices"])[: len(joints)]
                inverse = np.swapaxes(columns.reshape(-1, 4, 4), 1, 2)
            for primitive in objects(entry(document.json, "meshes", node["mesh"]), "primitives"):
                try:
                    vertices, carriers, shares = _attributes(document, primitive)
                except GltfError:
                    continue
                yield Skin(joints, inverse, vertices, carriers, shares)


def _attributes(document: Document, primitive: Json) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, carriers and shares. Raises GltfError where they are compressed."""
    attributes = primitive["attributes"]
    if DRACO in primitive.get("extensions", {}) or "POSITION" not in attributes:
        raise GltfError("this mesh is compressed")
    positions = numbers(document, attributes["POSITION"])
    sets = [number for number in range(len(attributes)) if f"JOINTS_{number}" in attributes]
    carriers = np.concatenate([raw_numbers(document, attributes[f"JOINTS_{number}"]) for number in sets], axis=1)
    raw = [raw_numbers(document, attributes[f"WEIGHTS_{number}"]) for number in sets]
    shares = np.concatenate([part if part.dtype.kind == "f" else denormalised(part) for part in raw], axis=1)
    shares = shares / np.maximum(shares.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    return np.column_stack((positions, np.ones(len(positions)))), carriers.astype(np.int64), shares
