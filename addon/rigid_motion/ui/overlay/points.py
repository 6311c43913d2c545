"""Sampled motion paths as arrays: places of an object natively and in its mode, and the ticks to draw on them.

Points are (n, 3), in the world or in the space of the object's channels, its own delta transforms included. Frames are
those of the Action. No window and no graphics card is needed here.

On a short path, or one seen from afar, ticks would merge into a solid bar. They stay evenly timed: if the object moves
too little from tick to tick, only every second, fifth, tenth... is kept. Where the object nearly rests, ticks too close
to one another or to a key are left out. Distances are in pixels at a resolution scale of 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .ghosts import Ghosts

MIN_PATH_SAMPLES = 256
"""A path has at least this many samples, so that its bends look round; or one on every frame, if these are more."""

MAX_SAMPLES_PER_FRAME = 16
"""The most samples per frame."""

MAX_PATH_SAMPLES = 8192
"""Approximate maximum of samples, and of ticks, per path. With more frames, samples are further apart."""

MAX_TICKS, MAX_AXES = 60, 20
"""Approximate maximum of ticks per path unless more were requested, and of ticks with axes."""


SMOOTH_EXTENT_WIDTHS = 5000
"""The extent of a path, in widths of its line, up to which no corners show on the screen."""

TICK_GAP = 14.0
"""Minimum distance between ticks where the object moves at its usual speed, in pixels."""

AXES_GAP = 36.0
"""Minimum distance between axes at that speed, in pixels."""

MIN_TICK_DISTANCE_PX = 9.0
"""Minimum distance of a tick to its neighbours and to keys, in pixels."""

AT_REST = 1.0
"""Shorter distances between ticks, in pixels, do not count for the usual speed."""

TICK_STEPS_FRAMES = [digit * 10**power for power in range(7) for digit in (1, 2, 5)]


PASSING_HOLDER = -1
"""The holder's number while an object passes from one holder to another."""


class Piece(NamedTuple):
    """A part of a path, between two indices of its points, both included."""

    first: int
    last: int

    holder: int
    """The number of its holder there, 0 for the world, or PASSING_HOLDER."""


@dataclass(frozen=True, eq=False)
class DrawnPath:
    """The path of an object's origin or a point of a bone, with Blender's in-betweens and with those of a mode."""

    frames: np.ndarray
    """Rising frames, shape (m,): whole frames (or as many as can be told apart), frames between them, and keys."""

    native: np.ndarray
    """Places on these frames with Blender's interpolation, shape (m, 3)."""

    desired: np.ndarray | None
    """Places in the mode, shape (m, 3). None if there is no other mode than Blender's."""

    key_frames: np.ndarray
    """Frames of the Action with keys, shape (k,)."""

    keys: np.ndarray
    """Places on the keys, shape (k, 3), the same in all modes."""

    selected: np.ndarray
    """True for selected keys, shape (k,)."""

    tick_frames: np.ndarray
    """Evenly spaced frames, shape (t,)."""

    native_ticks: np.ndarray
    """Places on these frames with Blender's interpolation, shape (t, 3)."""

    desired_ticks: np.ndarray | None
    """Places on these frames in the mode, shape (t, 3). None without a mode."""

    axis_frames: np.ndarray
    """Frames of the ticks with axes, shape (a,)."""

    axes: np.ndarray
    """Local axes on these frames, in the mode or else natively, by their two ends: shape (a, 3, 2, 3)."""

    in_world: bool = False
    """True if all places are in the world, and not in the space of the channels."""

    ghosts: Ghosts | None = None
    """Ghosts every few frames; None if they were not requested."""

    pieces: tuple[Piece, ...] = ()
    """Its pieces by holder, in the order of its points; empty if it is never held."""

    @property
    def line(self) -> np.ndarray:
        """Places in the mode, or else with Blender's interpolation, shape (m, 3)."""
        return self.native if self.desired is None else self.desired

    def at(self, frame: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return its places at a frame, natively and in the mode, (3,) each. Outside of the path its ends count."""

        def point(line: np.ndarray) -> np.ndarray:
            return np.array([np.interp(frame, self.frames, column) for column in line.T])

        return point(self.native), None if self.desired is None else point(self.desired)


def sample_frames(first: int, last: int) -> np.ndarray:
    """Return evenly spaced frames from the first to the last whole one, close enough for the path to look round."""
    length = last - first
    if length > MAX_PATH_SAMPLES:
        return np.append(np.arange(first, last, -(-length // MAX_PATH_SAMPLES)), last).astype(np.float64)
    # Powers of two, so that whole frames are hit exactly.
    finer = min(2 ** int(np.ceil(np.log2(max(MIN_PATH_SAMPLES / length, 1.0)))), MAX_SAMPLES_PER_FRAME)
    return first + np.arange(length * finer + 1) / finer


def tick_frames(first: int, last: int, step: int = 0) -> np.ndarray:
    """Return the multiples of a step, the same for all objects, from the first frame to the last.

    A step of 0 chooses 1, 2, 5, 10...
    """
    length = last - first
    step = max(step, -(-length // MAX_PATH_SAMPLES)) if step else _round_step(length, MAX_TICKS)
    return np.arange(-(-first // step), last // step + 1.0) * step


def axis_frames(ticks: np.ndarray) -> np.ndarray:
    """Return the ticks that have axes."""
    if len(ticks) < 2:
        return ticks
    step = ticks[1] - ticks[0]
    return ticks[ticks % (step * _round_step(len(ticks), MAX_AXES)) == 0.0]


def _round_step(length: int, most: int) -> int:
    """Return the smallest of 1, 2, 5, 10, 20... that fits into a length at most this many times."""
    return next(step for step in TICK_STEPS_FRAMES if length <= most * step)


def thinned(line: np.ndarray) -> np.ndarray:
    """Return a line without the points that make no visible difference, shape (fewer, 3).

    Every other point is dropped where the line stays within 1/`SMOOTH_EXTENT_WIDTHS` of its extent. This is repeated
    until every point is needed.
    """
    if len(line) < 3:
        return line
    tolerance = float(np.ptp(line, axis=0).max()) / SMOOTH_EXTENT_WIDTHS
    while True:
        start, middle, end = line[:-2:2], line[1:-1:2], line[2::2]
        chord, offset = end - start, middle - start
        length = np.einsum("ij,ij->i", chord, chord)
        share = np.einsum("ij,ij->i", chord, offset) / np.where(length > 0.0, length, 1.0)
        away = offset - np.clip(share, 0.0, 1.0)[:, None] * chord
        stays = np.ones(len(line), dtype=bool)
        stays[1:-1:2] = np.einsum("ij,ij->i", away, away) > tolerance * tolerance
        if stays.all():
            return line
        line = line[stays]


@dataclass(frozen=True, eq=False)
class Readable:
    """The ticks and axes of a path that are drawn in a view."""

    native_ticks: np.ndarray
    """True for ticks that are drawn on Blender's path, shape (t,)."""

    desired_ticks: np.ndarray | None
    """True for ticks that are drawn on the mode's path, shape (t,). None without a mode."""

    axes: np.ndarray
    """True for axes that are drawn, shape (a,)."""


def readable(
    path: DrawnPath, projection: np.ndarray, size: tuple[float, float], scale: float = 1.0, *, every_tick: bool = False
) -> Readable:
    """Return the ticks and axes of a path that are legible in a view.

    Parameters
    ----------
    path : DrawnPath
    projection : array, shape (4, 4)
        From the space of the path to clip space, for homogeneous column vectors.
    size : tuple
        Width and height of the view in pixels.
    scale : float
        The resolution scale of the interface.
    every_tick : bool
        Draw all ticks, since exactly these were requested.
    """

    def pixels(points: np.ndarray) -> np.ndarray:
        return on_screen(points, projection, size) / scale

    native, axes = pixels(path.native_ticks), pixels(path.axes[:, 0, 0])
    desired = None if path.desired_ticks is None else pixels(path.desired_ticks)
    some_axes = _spaced(axes, _legible_step(axes, AXES_GAP), np.empty((0, 2)), 0.5 * AXES_GAP, path.axis_frames)
    if every_tick:
        every = np.ones(len(native), dtype=bool)
        return Readable(every, None if desired is None else every, some_axes)
    keys = pixels(path.keys)
    # Use the same frames on both paths, to make them comparable.
    step = _legible_step(native if desired is None else desired, TICK_GAP)
    return Readable(
        _spaced(native, step, keys, MIN_TICK_DISTANCE_PX, path.tick_frames),
        None if desired is None else _spaced(desired, step, keys, MIN_TICK_DISTANCE_PX, path.tick_frames),
        some_axes,
    )


def on_screen(points: np.ndarray, projection: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return the pixels (n, 2) of points (n, 3) in a view, NaN behind the viewer."""
    clip = points @ projection[:, :3].T + projection[:, 3]
    depth = np.where(clip[:, 3] > 0.0, clip[:, 3], np.nan)
    return 0.5 * (clip[:, :2] / depth[:, None] + 1.0) * size


def _legible_step(pixels: np.ndarray, gap: float) -> int:
    """Return the smallest step of 1, 2, 5, 10... points (n, 2) with a median distance of at least the gap.

    0 if there is none.
    """
    for step in TICK_STEPS_FRAMES:
        across, up = (pixels[step::step] - pixels[:-step:step]).T
        moved = np.sort(np.hypot(across, up))
        moved = moved[moved > AT_REST]
        if not len(moved):
            return 0
        if moved[len(moved) // 2] >= gap:
            return step
    return 0


def _spaced(pixels: np.ndarray, step: int, keys: np.ndarray, clear: float, frames: np.ndarray) -> np.ndarray:
    """Return which points (n, 2) are on multiples of the step, and `clear` pixels away from others and keys (k, 2)."""
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
