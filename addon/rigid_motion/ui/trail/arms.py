"""Tangents at the selected keys of paths: a handle on each side of a key shows the speed there."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...blender import scene
from ..overlay.points import MAX_TICKS, DrawnPath, on_screen
from ..overlay.settings import overlay_settings
from .handles import Handles, key_under, nearest_under
from .tool import TOOL

HANDLE_SECONDS = 1.0 / 3.0
"""A handle is as long as the distance travelled in this time."""

MIN_HANDLE_PX = 28.0
"""Minimum length of a handle, in pixels at a resolution scale of 1: slow motion, too, has handles to grab."""


SAMPLES_BESIDE_KEY = (1, 2, 3)
"""Tangents are read from these samples beside a key, counted from it."""


def arms_of(path: DrawnPath) -> tuple[np.ndarray, np.ndarray]:
    """Return the tangents at the keys of a path, before and after each key, in the path's space, away from the key.

    Two arrays (k, 2, 3): velocities in units per frame, from the samples beside keys; and the vectors to the nearest
    samples, which have a direction even where the body comes to rest. Both are NaN beyond the ends of the path.
    """
    at = np.searchsorted(path.frames, path.key_frames)
    steps = at[:, None, None] + np.array((-1, 1))[:, None] * SAMPLES_BESIDE_KEY
    within = np.clip(steps, 0, len(path.line) - 1)
    times = np.abs(path.frames[within] - path.key_frames[:, None, None])
    ways = np.where((steps == within)[..., None], path.line[within] - path.line[at][:, None, None], np.nan)
    # Slope of the cubic through the key and three samples.
    apart = times[..., None] - times[..., None, :] + np.eye(len(SAMPLES_BESIDE_KEY))
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = times.prod(axis=-1, keepdims=True) / (times**2 * apart.prod(axis=-1))
        return np.einsum("ksn,ksnc->ksc", weights, ways), ways[:, :, 0]


def ends_of(path: DrawnPath, projection: np.ndarray, size: tuple[float, float], scale: float) -> np.ndarray:
    """Return the end points of the handles of the selected keys, in the space of the path, shape (k, 2, 3).

    `projection` (4, 4) maps that space to clip space of a view of this size.
    """
    velocities, ways = (rows[path.selected] for rows in arms_of(path))
    keys, frames = path.keys[path.selected][:, None], HANDLE_SECONDS * frame_rate()
    lengths = np.linalg.norm(frames * velocities, axis=-1, keepdims=True)
    directions = np.where(lengths > 1e-9, frames * velocities, ways)

    def pixels(arms: np.ndarray) -> np.ndarray:
        both = (on_screen(points.reshape(-1, 3), projection, size) for points in (keys + arms, keys + 0.0 * arms))
        return np.linalg.norm(np.subtract(*both), axis=-1).reshape(*arms.shape[:2], 1)

    return keys + directions * np.maximum(1.0, MIN_HANDLE_PX * scale / np.maximum(pixels(directions), 1e-6))


def frame_rate() -> float:
    """Return the frames per second."""
    render = scene().render
    return float(render.fps / render.fps_base)


def is_shown(path: DrawnPath, overlay: Any) -> bool:
    """Return whether handles of a path are shown: while the tool is active and the overlay shows keyed modes."""
    context: Any = bpy.context
    tool = context.workspace.tools.from_space_view3d_mode(context.mode)
    is_edited = tool is not None and tool.idname == TOOL and overlay.show_paths and overlay.mode == "CHOSEN"
    return bool(is_edited and path.desired is not None and 0 < np.count_nonzero(path.selected) <= MAX_TICKS)


def tangent_under(context: Any, handles: list[Handles], place: np.ndarray) -> tuple[Handles, float, int] | None:
    """Return the handle at a place on the screen: its path, the frame of its key, and its side.

    None if there is no handle, or if there is a key.
    """
    if key_under(context, handles, place) is not None:
        return None
    size, view = (context.region.width, context.region.height), context.region_data.perspective_matrix

    def ends(one: Handles) -> np.ndarray:
        projection = np.array(view @ one.space)
        there = ends_of(one.path, projection, size, context.preferences.system.ui_scale)
        return on_screen(there.reshape(-1, 3), projection, size)

    shown = ((one, ends(one)) for one in handles if is_shown(one.path, overlay_settings(scene())))
    hit = nearest_under(context, shown, place)
    return None if hit is None else (hit[0], float(hit[0].selected[hit[1] // 2]), hit[1] % 2)
