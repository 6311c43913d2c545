"""The object that the viewer moves: triangles in metres, in the body's own axes, y forward and z up as in Blender."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from rigid_motion_batch.places import ASSETS

CREASE = np.cos(np.radians(35.0))
"""Faces that meet at a sharper angle keep an edge between them, in the shading and in the wireframe."""

MOST_TRIANGLES = 6000
"""More would make the page slow and large."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of at most `MOST_TRIANGLES` triangles.

    Raises
    ------
    ValueError
        Where it has more, or none.
    """

    vertices: np.ndarray
    """Shape (v, 3), in metres."""

    triangles: np.ndarray
    """Shape (t, 3), numbers of vertices, counter-clockwise from outside."""

    tints: np.ndarray | None = None
    """Shape (t,), 0 to 1: how much of a triangle's colour is its mode's, and not grey. All of it unless given."""

    def __post_init__(self) -> None:
        if not 0 < len(self.triangles) <= MOST_TRIANGLES:
            raise ValueError(f"{len(self.triangles)} triangles; give the viewer 1 to {MOST_TRIANGLES}")

    @property
    def size(self) -> float:
        """The diagonal of the bounding box, in metres."""
        return float(np.linalg.norm(np.ptp(self.vertices[np.unique(self.triangles)], axis=0)))

    @property
    def middle(self) -> np.ndarray:
        """Of the bounding box, shape (3,)."""
        used = self.vertices[np.unique(self.triangles)]
        return (used.min(axis=0) + used.max(axis=0)) / 2.0

    def corners(self) -> np.ndarray:
        """Return what is drawn of every corner of every triangle, shape (7, 3 t): its place, its normal, its tint."""
        places, faces, owners = self._faces()
        normals = np.zeros((len(owners), 3))
        order = np.argsort(owners, kind="stable")
        starts = np.searchsorted(owners[order], np.arange(owners.max() + 2))
        for first, last in pairwise(starts.tolist()):
            around = order[first:last]
            own = faces[around // 3]
            unit = own / np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-30)
            normals[around] = (unit @ unit.T > CREASE) @ own
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        tints = np.ones(len(faces)) if self.tints is None else np.asarray(self.tints, dtype=float)
        return np.concatenate((places.T, normals.T, np.repeat(tints, 3)[None]))

    def edges(self) -> np.ndarray:
        """Both ends of every sharp edge, shape (6, e)."""
        places, faces, owners = self._faces()
        pairs = owners.reshape(-1, 3)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        ordered, kinds = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        unit = faces / np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-30)
        sums = np.zeros((len(ordered), 3))
        counts = np.bincount(kinds.ravel(), minlength=len(ordered))
        np.add.at(sums, kinds.ravel(), np.repeat(unit, 3, axis=0))
        # The sum of two unit vectors is as long as the angle between them is small.
        flat = (counts == 2) & ((sums * sums).sum(axis=1) > 2.0 + 2.0 * CREASE)
        _, firsts = np.unique(owners, return_index=True)
        ends = places[firsts][ordered[~flat]]
        return ends.reshape(-1, 6).T

    def _faces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places of all corners (3 t, 3), normals of faces by their size (t, 3), and which corners are at one place."""
        places = np.asarray(self.vertices, dtype=float)[self.triangles].reshape(-1, 3)
        _, owners = np.unique(np.round(places, 6), axis=0, return_inverse=True)
        a, b, c = places.reshape(-1, 3, 3).transpose(1, 0, 2)
        return places, np.cross(b - a, c - a), owners.ravel()


@cache
def drill() -> Mesh:
    """Return the drill that films have, of few triangles."""
    return Mesh(**np.load(ASSETS / "drill.npz"))
