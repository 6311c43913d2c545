"""Drawing ghosts in the 3D viewport: what they look like is on the graphics card once, and placed by a matrix each."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import gpu
import numpy as np
from bpy.app.handlers import persistent
from mathutils import Matrix

from ...animation.handlers import append_handlers, remove_handlers
from ...animation.transforms import Transform
from ..look import Color
from .ghosts import Ghosts, shape_of

SOLID, EDGES = 0.15, 0.55
"""Opacity of the triangles and of the edges of a ghost."""

WIDTH = 1.0
"""The width of edges, in pixels at a resolution scale of 1."""

NEAR = 0.5
"""Frames from the current one within which there is no ghost, since the thing itself is there."""

Batches = tuple[gpu.types.GPUBatch | None, gpu.types.GPUBatch | None]
"""The triangles and the edges of a shape; None where there are none."""

_shapes: dict[tuple[int, str], Batches] = {}
"""By the identity of what is moved."""


def draw_ghosts(
    transform: Transform,
    ghosts: Ghosts,
    frame: float,
    color: Color,
    draw_line: Callable[[gpu.types.GPUBatch | None, Color, float], None],
    make_batch: Callable[[str, np.ndarray], gpu.types.GPUBatch | None],
) -> None:
    """Draw all ghosts of something but that of the current frame, in the space that the matrix stack is at.

    Parameters
    ----------
    transform : Transform
    ghosts : Ghosts
    frame : float
        The current frame, as the keys have it.
    color : tuple
        Its opacity is that of a path.
    draw_line, make_batch : callable
        Draw a batch of lines of a width, and make a batch of points, as for paths.
    """
    identity = transform.animated.session_uid, transform.prefix
    if identity not in _shapes:
        shape = shape_of(transform, bpy.context.view_layer.depsgraph)
        _shapes[identity] = make_batch("TRIS", shape.triangles), make_batch("LINES", shape.lines)
    triangles, lines = _shapes[identity]
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    red, green, blue, opacity = color
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.face_culling_set("BACK")
    try:
        for at, matrix in zip(ghosts.frames.tolist(), ghosts.matrices, strict=True):
            if abs(at - frame) < NEAR:
                continue
            with gpu.matrix.push_pop():
                gpu.matrix.multiply_matrix(Matrix(matrix))
                if triangles:
                    shader.uniform_float("color", (red, green, blue, SOLID * opacity))
                    triangles.draw(shader)
                draw_line(lines, (red, green, blue, EDGES * opacity), WIDTH)
    finally:
        gpu.state.face_culling_set("NONE")
        gpu.state.depth_test_set("NONE")


@persistent
def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _shapes:
        edited = {update.id.original.session_uid for update in depsgraph.updates if update.is_updated_geometry}
        for identity in [identity for identity in _shapes if identity[0] in edited]:
            del _shapes[identity]


@persistent
def _on_file(*_: object) -> None:
    _shapes.clear()


HANDLERS = {"depsgraph_update_post": _on_update, "undo_post": _on_file, "redo_post": _on_file, "load_post": _on_file}


def register() -> None:
    append_handlers(HANDLERS)


def unregister() -> None:
    remove_handlers(HANDLERS)
    _shapes.clear()
