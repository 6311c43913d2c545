"""Closed shells: the solids that a model is put together from, as plain arrays.

Millimetres. A shell is lofted through rings of points, its faces look outward, and each face names its material. The
shells of a model may cut through one another; each of them is closed in itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

X, Y, Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class Shell:
    """Vertices of shape (n, 3), faces as tuples of their indices, and a material's name for each face."""

    vertices: np.ndarray
    faces: list[tuple[int, ...]]
    materials: list[str]


def loft(rings: ArrayLike, material: str, *, endless: bool = False) -> Shell:
    """Return a solid through rings of shape (k, m, 3), closed by a flat face at each end, or by its beginning."""
    rings = np.asarray(rings, dtype=np.float64)
    index = np.arange(rings.shape[0] * rings.shape[1]).reshape(rings.shape[:2])
    ahead, beside, across = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1), np.roll(index, -1, axis=(0, 1))
    quads = np.stack((index, beside, across, ahead), axis=-1)
    faces = (quads if endless else quads[:-1]).reshape(-1, 4).tolist()
    if not endless:
        faces += [index[0, ::-1].tolist(), index[-1].tolist()]
    return _outward(Shell(rings.reshape(-1, 3), [tuple(face) for face in faces], [material] * len(faces)))


def _outward(shell: Shell) -> Shell:
    if volume(shell) >= 0.0:
        return shell
    return Shell(shell.vertices, [face[::-1] for face in shell.faces], shell.materials)


def volume(shell: Shell) -> float:
    """Return the volume inside; negative where the faces look inward."""
    triangles = shell.vertices[[(face[0], a, b) for face in shell.faces for a, b in pairwise(face[1:])]]
    return float(np.linalg.det(triangles).sum() / 6.0)


# ---- rings -----------------------------------------------------------------------------------------------------------


def oval(centre: ArrayLike, a: ArrayLike, b: ArrayLike, exponent: float = 2.0, points: int = 24) -> np.ndarray:
    """Return a superellipse about `centre` with the half axes `a` and `b` (vectors): 2 an ellipse, more is squarer."""
    angle = 2.0 * np.pi * (np.arange(points) + 0.5) / points
    c, s = np.cos(angle), np.sin(angle)
    stretch = (np.abs(c) ** exponent + np.abs(s) ** exponent) ** (-1.0 / exponent)
    return np.asarray(centre) + np.outer(stretch * c, a) + np.outer(stretch * s, b)


def slab(centre: ArrayLike, a: ArrayLike, b: ArrayLike, radius: float, steps: int = 4) -> np.ndarray:
    """Return a rectangle about `centre` with the half sides `a` and `b` (vectors) and corners of a radius."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    long, wide = np.linalg.norm(a), np.linalg.norm(b)
    turn = np.linspace(0.0, 0.5 * np.pi, steps)
    corners = [(1, 1, 0.0), (-1, 1, 0.5), (-1, -1, 1.0), (1, -1, 1.5)]
    x = np.concatenate([i * (long - radius) + radius * np.cos(turn + start * np.pi) for i, _, start in corners])
    y = np.concatenate([j * (wide - radius) + radius * np.sin(turn + start * np.pi) for _, j, start in corners])
    return np.asarray(centre) + np.outer(x, a / long) + np.outer(y, b / wide)


# ---- solids ----------------------------------------------------------------------------------------------------------


def lathe(centre: ArrayLike, axis: ArrayLike, profile: ArrayLike, material: str, points: int = 24) -> Shell:
    """Return a body of revolution about an axis; the profile is a list of (distance along the axis, radius)."""
    axis, a, b = frame(axis)
    centre = np.asarray(centre)
    return loft([oval(centre + along * axis, r * a, r * b, points=points) for along, r in profile], material)


def block(
    centre: ArrayLike, half: ArrayLike, radius: float, edge: float, material: str, *, axis: int = 2, steps: int = 2
) -> Shell:
    """Return a box of half sides `half`, its corners round the `axis` of a radius, its two ends rounded off by `edge`.

    `steps` points make a rounding: 2 are a chamfer.
    """
    units, half = np.eye(3), np.asarray(half, dtype=np.float64)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rings = []
    for along, inset in rounded_ends(half[axis], edge, steps):
        middle, (a, b) = np.asarray(centre) + along * units[axis], ((half[k] - inset) * units[k] for k in (i, j))
        rings.append(slab(middle, a, b, radius - 0.6 * inset, steps))
    return loft(rings, material)


def rounded_ends(half: float, edge: float, steps: int = 4) -> list[tuple[float, float]]:
    """Return (distance from the middle, inset) from end to end of a body whose two ends are rounded off by `edge`."""
    turn = np.linspace(0.5 * np.pi, 0.0, steps)
    end = np.column_stack((half - edge + edge * np.sin(turn), edge * (1.0 - np.cos(turn))))
    return [*(end * (-1.0, 1.0)).tolist(), *end[::-1].tolist()]


def tube(path: ArrayLike, radius: float, material: str, points: int = 10) -> Shell:
    """Return a round tube along a path (k, 3) that nowhere runs along the x axis."""
    path = np.asarray(path, dtype=np.float64)
    ahead = unit(np.gradient(path, axis=0))
    across = unit(np.cross(ahead, X))
    frames = zip(path, across, np.cross(ahead, across), strict=True)
    return loft([oval(p, radius * a, radius * b, points=points) for p, a, b in frames], material)


def pad(rings: np.ndarray, centres: np.ndarray, first: int, last: int, height: float, material: str) -> Shell:
    """Return a pad on a lofted surface: on the points `first` to `last` of its rings (k, m, 3), `height` above them.

    Its walls are steep and sunk into the surface; its underside, which nobody sees, is flat.
    """
    patch = _with_walls(_with_walls(rings[:, first : last + 1], axis=0), axis=1)
    middle = _with_walls(centres, axis=0)[:, None]
    out = unit(patch - middle)
    lift = np.full(patch.shape[:2], height)
    lift[[0, -1]] = lift[:, [0, -1]] = -0.4
    bottom = patch[:, [-1, 0]] - 3.0 * out[:, [-1, 0]]
    return loft(np.concatenate((patch + lift[..., None] * out, bottom), axis=1), material)


def _with_walls(points: np.ndarray, axis: int) -> np.ndarray:
    """Return the points and, close to the first and the last along an axis, another: a wall stands between the two."""
    points = np.moveaxis(points, axis, 0)
    width = 0.12
    start = (1.0 - width) * points[:1] + width * points[1:2]
    end = (1.0 - width) * points[-1:] + width * points[-2:-1]
    return np.moveaxis(np.concatenate((points[:1], start, points[1:-1], end, points[-1:])), 0, axis)


def curve(points: ArrayLike, count: int) -> np.ndarray:
    """Return `count` places on the Catmull-Rom spline through `points` (k, d): coordinates, and maybe radii."""
    points = np.asarray(points, dtype=np.float64)
    padded = np.concatenate((2.0 * points[:1] - points[1:2], points, 2.0 * points[-1:] - points[-2:-1]))
    s = np.linspace(0.0, len(points) - 1.0, count)
    i = np.minimum(s.astype(int), len(points) - 2)
    u = (s - i)[:, None]
    p0, p1, p2, p3 = (padded[i + step] for step in range(4))
    return p1 + 0.5 * u * (p2 - p0 + u * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + u * (3.0 * (p1 - p2) + p3 - p0)))


def frame(axis: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the unit vector along `axis` and two at right angles to it, right-handed."""
    axis = unit(np.asarray(axis, dtype=np.float64))
    a = unit(np.cross(Z if abs(axis[2]) < 0.9 else X, axis))
    return axis, a, np.cross(axis, a)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., d) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def merged(shells: Sequence[Shell]) -> Shell:
    """Return all shells as one, each still closed in itself."""
    offsets = np.cumsum([0, *(len(shell.vertices) for shell in shells[:-1])])
    faces = [
        tuple(i + int(offset) for i in face)
        for shell, offset in zip(shells, offsets, strict=True)
        for face in shell.faces
    ]
    vertices = np.concatenate([shell.vertices for shell in shells])
    return Shell(vertices, faces, [name for shell in shells for name in shell.materials])


# ---- shading ---------------------------------------------------------------------------------------------------------


def corner_normals(shell: Shell, crease: float = np.radians(38.0)) -> np.ndarray:
    """Return a normal for each corner of each face, in the order of the faces, shape (corners, 3).

    The mean, by area, of the faces that meet at the corner and are turned from its own face by less than `crease`: a
    wide flat face stays flat, the rounding beside it is smooth, an edge is an edge.
    """
    sizes = np.array([len(face) for face in shell.faces])
    vertex = np.concatenate(shell.faces)
    face = np.repeat(np.arange(len(shell.faces)), sizes)
    start = np.cumsum(sizes) - sizes
    following = np.arange(len(vertex)) + 1
    following[start + sizes - 1] = start
    # Newell: half the sum of the cross products round a face is its area times its normal.
    crosses = np.cross(shell.vertices[vertex], shell.vertices[vertex[following]])
    areas = 0.5 * np.add.reduceat(crosses, start, axis=0)
    directions = unit(areas)

    order = np.argsort(vertex, kind="stable")
    valence = np.bincount(vertex)
    first = np.cumsum(valence) - valence
    around = first[vertex][:, None] + np.arange(valence.max())
    present = np.arange(valence.max()) < valence[vertex][:, None]
    neighbours = face[order[np.where(present, around, 0)]]
    near = present & (np.einsum("ckx,cx->ck", directions[neighbours], directions[face]) > np.cos(crease))
    return unit(np.einsum("ck,ckx->cx", near, areas[neighbours]))
