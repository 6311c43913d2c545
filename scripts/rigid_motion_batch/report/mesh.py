"""The object that the viewer moves: triangles in metres, in the body's own axes, y forward and z up as in Blender."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

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
    """Return a drill: lofts through rounded sections; the origin is in the hand, the tip at (0, 0.16, 0.062)."""
    vertices: list[np.ndarray] = []
    triangles: list[np.ndarray] = []
    tints: list[np.ndarray] = []

    def loft(tint: float, corners: int, sections: list[tuple[np.ndarray, np.ndarray, np.ndarray, float]]) -> None:
        angles = 2.0 * np.pi * (np.arange(corners) + 0.5) / corners
        rings = []
        for centre, u, v, power in sections:
            x, y = (np.sign(some) * np.abs(some) ** (2.0 / power) for some in (np.cos(angles), np.sin(angles)))
            rings.append(centre + x[:, None] * u + y[:, None] * v)
        start = sum(map(len, vertices))
        vertices.append(np.concatenate([*rings, [sections[0][0], sections[-1][0]]]))
        at = start + corners * np.arange(len(rings))[:, None] + np.arange(corners)
        following = np.roll(at, -1, axis=1)
        low, high = at[:-1], at[1:]
        sides = [(low, following[:-1], following[1:]), (low, following[1:], high)]
        bottom, top = start + corners * len(rings) + np.arange(2)
        faces = [np.stack(side, axis=-1).reshape(-1, 3) for side in sides]
        faces.append(np.stack((following[0], at[0], np.full(corners, bottom)), axis=-1))
        faces.append(np.stack((at[-1], following[-1], np.full(corners, top)), axis=-1))
        triangles.extend(faces)
        tints.append(np.full(sum(map(len, faces)), tint))

    def along(y: float, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        return np.array((0, y, 0.062)), np.array((0, 0, radius)), np.array((radius, 0, 0)), 2.0

    def up(
        y: float, z: float, width: float, depth: float, power: float = 5.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        return np.array((0, y, z)), np.array((width, 0, 0)), np.array((0, depth, 0)), power

    body = ((-0.056, 0.015), (-0.05, 0.022), (-0.046, 0.0245), (0.052, 0.0245), (0.06, 0.022), (0.082, 0.0135))
    loft(1.0, 28, [along(*item) for item in body])
    loft(0.0, 20, [along(*item) for item in ((0.082, 0.0115), (0.103, 0.0105), (0.112, 0.006))])
    loft(0.0, 10, [along(*item) for item in ((0.112, 0.0032), (0.15, 0.0032), (0.16, 0.0002))])
    loft(0.25, 20, [up(-0.016, -0.05, 0.0145, 0.021), up(-0.006, 0.0, 0.0135, 0.0185), up(0.002, 0.042, 0.015, 0.024)])
    loft(1.0, 20, [up(-0.014, -0.074, 0.019, 0.034, 7.0), up(-0.014, -0.05, 0.019, 0.034, 7.0)])
    loft(0.0, 12, [up(0.022, 0.013, 0.006, 0.006, 4.0), up(0.026, 0.032, 0.006, 0.007, 4.0)])
    return Mesh(np.concatenate(vertices), np.concatenate(triangles), np.concatenate(tints))
