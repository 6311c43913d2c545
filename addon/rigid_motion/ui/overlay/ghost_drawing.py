"""Drawing of ghosts before and after the current frame, which fade with their distance from it.

If they would cover too much of the view, only every second, third, ... is drawn, and fainter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import gpu
import numpy as np
from mathutils import Matrix

from ...animation.transforms import Transform
from ...blender import existing, original_uid, persistent, view_layer
from ...handlers import append_drawing, append_handlers, remove_drawing, remove_handlers
from ..preferences import Color
from .drawing import Pen, batch_of, blended, drawn, own_space, path_drawers
from .ghost_bodies import OnCard, SeenBody, seen_bodies
from .ghosts import Ghosts, shape_of
from .points import DrawnPath
from .settings import RigidMotionOverlay, is_shown, overlay_settings

SOLID_OPACITY, EDGE_OPACITY = 0.22, 0.6
"""Opacity of the triangles and of the edges of the ghost next to the current frame."""

LEAST_FADE = 0.25
"""The furthest ghost has this fraction of that opacity."""

EDGE_WIDTH = 1.0
"""Line width of edges, in pixels at a resolution scale of 1."""

MIN_GHOST_DISTANCE_FRAMES = 0.5
"""No ghost is drawn within so many frames of the current one, where the object itself is."""

MAX_COVERED_RATIO, FULL_CONTRAST_RATIO = 1.5, 0.4
"""How many times ghosts may cover the view in all, and up to where they keep full contrast."""


_shapes: dict[tuple[int, str], OnCard] = {}
"""Ghosts of objects and bones by the identity of their transform."""

_with_bodies: set[int] = set()
"""The session ids of armatures whose bones have no ghosts, since their meshes have."""


@persistent
def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _shapes:
        forget({original_uid(update) for update in depsgraph.updates if update.is_updated_geometry})


@persistent
def _on_file(*_: object) -> None:
    forget()


HANDLERS: dict[str, Callable] = {
    "depsgraph_update_post": _on_update,
    "undo_post": _on_file,
    "redo_post": _on_file,
    "load_post": _on_file,
}


def register() -> None:
    append_handlers(HANDLERS)
    path_drawers.append(draw_ghosts)
    append_drawing(bpy.types.SpaceView3D, draw_bodies)


def unregister() -> None:
    remove_drawing(bpy.types.SpaceView3D, draw_bodies)
    path_drawers.remove(draw_ghosts)
    remove_handlers(HANDLERS)
    forget()


def forget(uids: set[int] | None = None) -> None:
    """Drop the shapes of objects with these session ids, or all, to read them again."""
    for identity in [identity for identity in _shapes if uids is None or identity[0] in uids]:
        del _shapes[identity]


def fades(frames: np.ndarray, now: float, settings: RigidMotionOverlay) -> np.ndarray:
    """Return the contrast (0 to 1) of ghosts (g,) on rising frames: 0 for ghosts that are not shown."""
    result = np.zeros(len(frames))
    before = np.flatnonzero(frames < now - MIN_GHOST_DISTANCE_FRAMES)[::-1][: settings.ghosts_before]
    behind = np.flatnonzero(frames > now + MIN_GHOST_DISTANCE_FRAMES)[: settings.ghosts_after]
    for chosen in (before, behind):
        result[chosen] = np.linspace(1.0, LEAST_FADE, len(chosen))
    return result


def thinned_out(fade: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Return the contrast left to ghosts (g,), given the fraction of the view that each covers.

    The same ghosts are kept wherever the current frame is.
    """
    numbers, step = np.arange(len(fade)), 1
    while step < len(fade) and covered[(fade > 0.0) & (numbers % step == 0)].sum() > MAX_COVERED_RATIO:
        step += 1
    left = np.where(numbers % step == 0, fade, 0.0)
    total = float(covered[left > 0.0].sum())
    return left * min(1.0, FULL_CONTRAST_RATIO / max(total, 1e-9))


def covered_by(corners: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Return the fraction of the view that each box covers, (g,).

    Corners are (8, 4), or (g, 8, 4) for each box; matrices (g, 4, 4) map them to clip space.
    """
    clip = corners @ matrices.transpose(0, 2, 1)
    is_near = (clip[..., 3] <= 0.0).any(axis=1)
    places = clip[..., :2] / np.where(clip[..., 3:] > 0.0, clip[..., 3:], 1.0)
    inside = np.clip(places, -1.0, 1.0)
    return np.where(is_near, 1.0, 0.25 * np.ptp(inside, axis=1).prod(axis=1))


def box_of(points: np.ndarray) -> np.ndarray:
    """Return the corners (8, 4) of the box around points (n, 3)."""
    ends = np.stack((points.min(axis=0), points.max(axis=0)))
    return np.array([(ends[i, 0], ends[j, 1], ends[k, 2], 1.0) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def tint(pen: Pen, frame: float, now: float, holder: int = 0) -> Color:
    """Return the colour of a ghost: that of its holder, or else that of the past or the future."""
    return pen.held_color(holder, pen.look.past_color if frame < now else pen.look.future_color)


def draw_ghosts(pen: Pen, transform: Transform, path: DrawnPath, now: float, settings: RigidMotionOverlay) -> None:
    """Draw the ghosts of a transform around a frame of its Action, in the space of the matrix stack."""
    identity, ghosts = transform.identity, path.ghosts
    if ghosts is None or transform.animated.session_uid in _with_bodies:
        return
    if identity not in _shapes:
        shape = shape_of(transform, existing(view_layer().depsgraph))
        corners = box_of(np.concatenate((shape.triangles, shape.lines)))
        _shapes[identity] = OnCard(batch_of("TRIS", shape.triangles), batch_of("LINES", shape.lines), corners)
    _draw(pen, ghosts, now, settings, lambda _: _shapes[identity])


@drawn
def draw_bodies() -> None:
    """Draw the ghosts of the selected armatures' meshes in the viewport being drawn."""
    context: Any = bpy.context
    _with_bodies.clear()
    settings = overlay_settings(context.scene)
    if not (settings.show_ghosts and settings.show_bodies and is_shown(context)):
        return
    pen, now = Pen(context), float(context.scene.frame_current_final)
    with blended():
        for rig, seen, frames in seen_bodies(context):
            _with_bodies.add(rig.session_uid)
            is_near = (frame for frame in seen.places if np.abs(frames - frame).min(initial=np.inf) < 1e-3)
            known = np.array(sorted(is_near))
            ghosts = Ghosts(known, np.tile(np.eye(4), (len(known), 1, 1)))
            _draw(pen, ghosts, now, settings, partial(_look_of_body, seen, known))


def _look_of_body(seen: SeenBody, frames: np.ndarray, number: int) -> OnCard:
    """Return the appearance of a mesh on one of the frames (n,) on which it was recorded, by its index."""
    frame = float(frames[number])
    if frame not in seen.batches:
        places = seen.places[frame]
        seen.batches[frame] = OnCard(batch_of("TRIS", places[seen.triangles.ravel()]), None, box_of(places))
    return seen.batches[frame]


def _draw(pen: Pen, ghosts: Ghosts, now: float, settings: RigidMotionOverlay, look_of: Callable[[int], OnCard]) -> None:
    """Draw ghosts around a frame, as far as the view has room; `look_of` returns the appearance of one by its index."""
    fade = fades(ghosts.frames, now, settings)
    looks = {number: look_of(number) for number in np.flatnonzero(fade).tolist()}
    if not looks:
        return
    view = np.array(gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
    corners = np.stack([look.corners for look in looks.values()])
    covered = np.zeros(len(fade))
    covered[[*looks]] = covered_by(corners, view @ ghosts.matrices[[*looks]])
    fade = thinned_out(fade, covered)
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.face_culling_set("BACK")
    try:
        # Furthest in time first, so that nearer ghosts cover them.
        for number in sorted(np.flatnonzero(fade).tolist(), key=lambda number: fade[number]):
            holder = 0 if ghosts.holders is None else int(ghosts.holders[number])
            *rgb, alpha = tint(pen, float(ghosts.frames[number]), now, holder)
            red, green, blue = rgb
            with own_space():
                gpu.matrix.multiply_matrix(Matrix(ghosts.matrices[number]))
                if triangles := looks[number].triangles:
                    shader.uniform_float("color", (red, green, blue, SOLID_OPACITY * alpha * fade[number]))
                    triangles.draw(shader)
                pen.line(looks[number].edges, (red, green, blue, EDGE_OPACITY * alpha * fade[number]), EDGE_WIDTH)
    finally:
        gpu.state.face_culling_set("NONE")
        gpu.state.depth_test_set("NONE")
