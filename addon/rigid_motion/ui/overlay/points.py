"""The points of a path: where an object comes through, natively and in a mode, as arrays for the overlay to draw.

Points are (n, 3), in the world or in the space of the object's channels, its own delta transforms included. Frames are
those of the Action. No window and no graphics card is needed here.

On a short path, or one that is looked at from afar, ticks would be a solid bar. They stay evenly timed: of a path that
moves too little from tick to tick, only every second, fifth, tenth... is left. Where the object nearly rests even those
are too close to one another, or to a key, and left out. Distances are in pixels at a resolution scale of 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .ghosts import Ghosts

MIN_PATH_SAMPLES = 256
"""A path gets this many samples, or one on every frame where those are more: bends look round then."""

MAX_SAMPLES_PER_FRAME = 16
"""The most samples in a frame."""

MAX_PATH_SAMPLES = 8192
"""About the most samples, and the most ticks, of one path. Where it has more frames, samples are further apart."""

MAX_TICKS, MAX_AXES = 60, 20
"""About the most ticks of a path where no more were requested, and the most of them with axes."""


SMOOTH_EXTENT_WIDTHS = 5000
"""The extent of a path, in widths of its line, up to which no corners show on the screen."""

TICK_GAP = 14.0
"""From tick to tick where the path goes at its usual speed, at least."""

AXES_GAP = 36.0
"""The gap from axes to axes."""

MIN_TICK_DISTANCE_PX = 9.0
"""From a tick to its neighbour, at least, and to a key."""

AT_REST = 1.0
"""The least distance from tick to tick that says something of the usual speed."""

TICK_STEPS_FRAMES = [digit * 10**power for power in range(7) for digit in (1, 2, 5)]


PASSING_HOLDER = -1
"""Where there is no single holder: what passes from one to another."""


class Piece(NamedTuple):
    """A part of a path, from one of its points to another, both included."""

    first: int
    last: int

    holder: int
    """The number of what holds it there, 0 for the world, or PASSING_HOLDER."""


@dataclass(frozen=True, eq=False)
class DrawnPath:
    """The path of an object's origin or of a point of a bone: as Blender's in-betweens have it, and as a mode does."""

    frames: np.ndarray
    """Shape (m,), rising, with the whole frames (or as many of them as can be told apart) and the keys."""

    native: np.ndarray
    """Places on these frames if Blender fills in, shape (m, 3)."""

    desired: np.ndarray | None
    """Places if the mode does, shape (m, 3). None where there is no other mode than Blender's."""

    key_frames: np.ndarray
    """Frames of the Action with keys, shape (k,)."""

    keys: np.ndarray
    """The keys, shape (k, 3). They are the same in all modes."""

    selected: np.ndarray
    """True for the keys that are selected, shape (k,)."""

    tick_frames: np.ndarray
    """Evenly spaced frames, shape (t,)."""

    native_ticks: np.ndarray
    """Places on these as Blender has it, shape (t, 3)."""

    desired_ticks: np.ndarray | None
    """Places on these as the mode has it, shape (t, 3)."""

    axis_frames: np.ndarray
    """Frames with ticks that have axes, shape (a,)."""

    axes: np.ndarray
    """The rotation on these, in the mode or else natively: the ends of its local axes, shape (a, 3, 2, 3)."""

    in_world: bool = False
    """True if all of it is in the space of the world, and not in that of the channels."""

    ghosts: Ghosts | None = None
    """The poses every few frames; None where that was not asked for."""

    pieces: tuple[Piece, ...] = ()
    """What holds it where, in the order of its points; empty for what nothing ever holds."""

    @property
    def line(self) -> np.ndarray:
        """The places of the mode, or else of Blender, shape (m, 3)."""
        return self.native if self.desired is None else self.desired

    def at(self, frame: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return where it is at a frame, natively and in the mode, each of shape (3,). The path holds its ends."""

        def point(line: np.ndarray) -> np.ndarray:
            return np.array([np.interp(frame, self.frames, column) for column in line.T])

        return point(self.native), None if self.desired is None else point(self.desired)


def sample_frames(first: int, last: int) -> np.ndarray:
    """Return evenly spaced frames from the first to the last whole one: close enough for a path to look round."""
    length = last - first
    if length > MAX_PATH_SAMPLES:
        return np.append(np.arange(first, last, -(-length // MAX_PATH_SAMPLES)), last).astype(np.float64)
    # Powers of two, so that whole frames are hit exactly.
    finer = min(2 ** int(np.ceil(np.log2(max(MIN_PATH_SAMPLES / length, 1.0)))), MAX_SAMPLES_PER_FRAME)
    return first + np.arange(length * finer + 1) / finer


def tick_frames(first: int, last: int, step: int = 0) -> np.ndarray:
    """Return the multiples of a step, the same for all objects, from the first frame to the last.
    0 chooses 1, 2, 5, 10...
    """
    length = last - first
    step = max(step, -(-length // MAX_PATH_SAMPLES)) if step else _round_step(length, MAX_TICKS)
    return np.arange(-(-first // step), last // step + 1.0) * step


def axis_frames(ticks: np.ndarray) -> np.ndarray:
    """Return those of the ticks that have axes."""
    if len(ticks) < 2:
        return ticks
    step = ticks[1] - ticks[0]
    return ticks[ticks % (step * _round_step(len(ticks), MAX_AXES)) == 0.0]


def _round_step(length: int, most: int) -> int:
    """Return the least of 1, 2, 5, 10, 20... that a length has at most this many of."""
    return next(step for step in TICK_STEPS_FRAMES if length <= most * step)


def thinned(line: np.ndarray) -> np.ndarray:
    """Return the points of a line without those that make no visible difference, shape (fewer, 3).

    Every other point goes where the line stays within 1/`SMOOTH_EXTENT_WIDTHS` of its extent, and so on until all have
    to stay.
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
    """What of a path is drawn in a view."""

    native_ticks: np.ndarray
    """True for its ticks that are drawn on Blender's path, shape (t,)."""

    desired_ticks: np.ndarray | None
    """True for its ticks that are drawn on the mode's path, shape (t,). None without one."""

    axes: np.ndarray
    """True for its axes that are drawn, shape (a,)."""


def readable(
    path: DrawnPath, projection: np.ndarray, size: tuple[float, float], scale: float = 1.0, *, every_tick: bool = False
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
        _spaced(native, step, keys, MIN_TICK_DISTANCE_PX, path.tick_frames),
        None if desired is None else _spaced(desired, step, keys, MIN_TICK_DISTANCE_PX, path.tick_frames),
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
