"""Ghosts of an object or bone every few frames: their places and shapes, as arrays.

An object is shown by its own geometry on the current frame, or by its axes if it has none; a bone as an octahedron. No
window and no graphics card is needed here.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...animation.transforms import Transform
from ...animation.transforms.sizes import drawn_size
from ...blender import existing
from ...motion.affine import AffineMaps

MOST_GHOSTS = 2000
"""Approximate maximum of ghosts per path: longer paths get larger steps."""

MOST_EDGES = 4000
"""The most edges that are drawn: more would hide one another, so none are."""

MOST_TRIANGLES = 2000000
"""An object with more triangles is shown by its bounding box."""

FEW_TRIANGLES = 6000
"""The most triangles of a ghost: enough to recognise it."""

MAX_CELLS = 96
"""Cells of the finest grid along the longest side of a mesh, see `fewer_triangles`."""

GEOMETRY = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that have triangles."""

WIDEST_BONE_RATIO = 0.1
"""Where the octahedron of a bone is widest, and its half-width there, as fractions of the bone's length."""

BOX_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
"""The edges of a bounding box, as indices of its corners in Blender's order."""


@dataclass(frozen=True, eq=False)
class Shape:
    """The shape of a ghost, in its own space."""

    lines: np.ndarray
    """The ends of the edges, two rows each, shape (2 e, 3)."""

    triangles: np.ndarray
    """The corners of the triangles, three rows each, shape (3 t, 3)."""


@dataclass(frozen=True, eq=False)
class Ghosts:
    """The places of an object or bone every few frames, in the space of its path."""

    frames: np.ndarray
    """Rising frames, shape (g,)."""

    matrices: np.ndarray
    """Matrices for homogeneous column vectors, shape (g, 4, 4)."""

    holders: np.ndarray | None = None
    """The numbers of its holders, see `points.Piece`, shape (g,). None if it is never held."""


def ghost_frames(first: int, last: int, step: int, keys: np.ndarray) -> np.ndarray:
    """Return the multiples of a step from the first to the last frame; for a negative step, the frames of keys (k,)."""
    if step < 0:
        return keys
    step = max(step, -(-(last - first) // MOST_GHOSTS))
    return np.arange(-(-first // step), last // step + 1.0) * step


def matrices_of(maps: AffineMaps) -> np.ndarray:
    """Return the matrices (n, 4, 4) of maps (n,)."""
    matrices = np.tile(np.eye(4), (len(maps.origins), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = maps.axes, maps.origins
    return matrices


def shape_of(transform: Transform, depsgraph: bpy.types.Depsgraph) -> Shape:
    """Return the shape of an object's or a bone's ghosts."""
    if transform.is_part:
        return octahedron(transform.pose_bone.bone.length)
    obj = transform.animated.evaluated_get(depsgraph)
    shape = _geometry(obj) if obj.type in GEOMETRY else None
    return shape or _box_or_axes(obj)


def octahedron(length: float) -> Shape:
    """Return the shape of a bone of this length along y, as Blender draws it."""
    wide = WIDEST_BONE_RATIO * length
    head, tail = np.zeros(3), np.array((0.0, length, 0.0))
    ring = [np.array((x, wide, z)) for x, z in ((wide, wide), (-wide, wide), (-wide, -wide), (wide, -wide))]
    edges, faces = [], []
    for one, following in zip(ring, (*ring[1:], ring[0]), strict=True):
        edges += [(head, one), (tail, one), (one, following)]
        faces += [(head, one, following), (tail, following, one)]
    return Shape(np.array(edges).reshape(-1, 3), np.array(faces).reshape(-1, 3))


def _geometry(obj: bpy.types.Object) -> Shape | None:
    """Return the triangles and edges of an evaluated object; None if it has no triangles or too many."""
    mesh = existing(obj.to_mesh())
    try:
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        if not 0 < count <= MOST_TRIANGLES:
            return None
        vertices = _read(mesh.vertices, "co", np.float32, 3)
        corners = _read(mesh.loop_triangles, "vertices", np.int32, 3)
        edges = _read(mesh.edges, "vertices", np.int32, 2) if len(mesh.edges) <= MOST_EDGES else corners[:0]
        kept, few = fewer_triangles(vertices, corners)
        return Shape(vertices[edges.ravel()], vertices[kept[few.ravel()]])
    finally:
        obj.to_mesh_clear()


def fewer_triangles(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a simpler mesh: the indices of kept vertices of (v, 3), and triangles (t, 3) as indices into these.

    All vertices in one cell of a grid become one.
    """
    kept, few, cells = np.arange(len(vertices)), triangles, MAX_CELLS
    extent = max(float(np.ptp(vertices, axis=0).max()), 1e-9)
    while len(few) > FEW_TRIANGLES:
        grid = ((vertices - vertices.min(axis=0)) * (cells / extent)).astype(np.int64)
        _, kept, cell = np.unique(grid @ (1, 4096, 4096**2), return_index=True, return_inverse=True)
        few = cell.reshape(-1)[triangles]
        apart = (few[:, 0] != few[:, 1]) & (few[:, 1] != few[:, 2]) & (few[:, 2] != few[:, 0])
        few, cells = few[apart], 2 * cells // 3
    return kept, few.astype(np.int32)


def _read(items: bpy.types.bpy_prop_collection, name: str, kind: type, width: int) -> np.ndarray:
    result: np.ndarray = np.empty(len(items) * width, kind)
    items.foreach_get(name, result)
    return result.reshape(-1, width)


def _box_or_axes(obj: bpy.types.Object) -> Shape:
    """Return the bounding box of an object, or a cross of its axes if it has no size."""
    corners = np.array(obj.bound_box)
    if np.ptp(corners) > 0.0:
        return Shape(corners[np.ravel(BOX_EDGES)], np.empty((0, 3)))
    size = drawn_size(obj) or 1.0
    ends = size * np.concatenate((np.eye(3), -np.eye(3)))
    return Shape(ends[[0, 3, 1, 4, 2, 5]], np.empty((0, 3)))
