"""Which ticks and axes of a path can be told apart in a view, so that they leave its line to be seen.

On a short path, or one that is looked at from afar, ticks would be a solid bar. They stay evenly timed: of a path that
moves too little from tick to tick, only every second, fifth, tenth... is left. Where the object nearly rests even those
are too close to one another, or to a key, and left out. Distances are in pixels at a resolution scale of 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .points import Path

TICK_GAP = 14.0
"""From tick to tick where the path goes at its usual speed, at least."""

AXES_GAP = 36.0
"""The gap from axes to axes."""

CLEAR = 9.0
"""From a tick to its neighbour, at least, and to a key."""

AT_REST = 1.0
"""The least distance from tick to tick that says something of the usual speed."""

STEPS = [digit * power for power in (1, 10, 100, 1000) for digit in (1, 2, 5)]


@dataclass(frozen=True, eq=False)
class Readable:
    """What of a path is drawn in a view."""

    native_ticks: np.ndarray
    """True for its ticks that are drawn on Blender's path, shape (t,)."""

    desired_ticks: np.ndarray | None
    """True for its ticks that are drawn on the mode's path, shape (t,). None without one."""

    axes: np.ndarray
    """True for its axes that are drawn, shape (a,)."""


def readable(
    path: Path, projection: np.ndarray, size: tuple[float, float], scale: float = 1.0, *, every_tick: bool = False
) -> Readable:
    """Return what of a path can be told apart in a view.

    Parameters
    ----------
    path : Path
    projection : array, shape (4, 4)
        From the space of the path to clip space, for columns of homogeneous coordinates.
    size : tuple
        Width and height of the view in pixels.
    scale : float
        The resolution scale of the interface.
    every_tick : bool
        Draw all ticks, since just these were requested.
    """

    def pixels(points: np.ndarray) -> np.ndarray:
        return on_screen(points, projection, size) / scale

    native, axes = pixels(path.native_ticks), pixels(path.axes[:, 0, 0])
    desired = None if path.desired_ticks is None else pixels(path.desired_ticks)
    some_axes = _spaced(axes, _step(axes, AXES_GAP), np.empty((0, 2)), 0.5 * AXES_GAP, path.axis_frames)
    if every_tick:
        every = np.ones(len(native), dtype=bool)
        return Readable(every, None if desired is None else every, some_axes)
    keys = pixels(path.keys)
    # The same frames on both, so that they can be compared.
    step = _step(native if desired is None else desired, TICK_GAP)
    return Readable(
        _spaced(native, step, keys, CLEAR, path.tick_frames),
        None if desired is None else _spaced(desired, step, keys, CLEAR, path.tick_frames),
        some_axes,
    )


def on_screen(points: np.ndarray, projection: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return where points (n, 3) are in a view, in pixels, shape (n, 2). Not a number behind the viewer."""
    clip = points @ projection[:, :3].T + projection[:, 3]
    depth = np.where(clip[:, 3] > 0.0, clip[:, 3], np.nan)
    return 0.5 * (clip[:, :2] / depth[:, None] + 1.0) * size


def _step(pixels: np.ndarray, gap: float) -> int:
    """Return the first of 1, 2, 5, 10... points (n, 2) after which a path has usually gone as far as
    the gap, 0 for none.
    """
    for step in STEPS:
        across, up = (pixels[step::step] - pixels[:-step:step]).T
        moved = np.sort(np.hypot(across, up))
        moved = moved[moved > AT_REST]
        if not len(moved):
            return 0
        if moved[len(moved) // 2] >= gap:
            return step
    return 0


def _spaced(pixels: np.ndarray, step: int, keys: np.ndarray, clear: float, frames: np.ndarray) -> np.ndarray:
    """Return which of these points (n, 2) are on multiples of the step, and clear of one another and of keys (k, 2)."""
    chosen = np.zeros(len(pixels), dtype=bool)
    if not step:
        return chosen
    between = frames[1] - frames[0] if len(frames) > 1 else 1.0
    across, up = (pixels[:, None] - keys).transpose(2, 0, 1)
    to_keys = np.hypot(across, up).min(axis=1, initial=np.inf)
    allowed = (frames % (between * step) == 0.0) & np.isfinite(pixels).all(axis=1) & (to_keys >= clear)
    indices = np.flatnonzero(allowed)
    before = (math.inf, math.inf)
    for index, point in zip(indices.tolist(), pixels[indices].tolist(), strict=True):
        if math.dist(point, before) >= clear:
            chosen[index], before = True, point
    return chosen
