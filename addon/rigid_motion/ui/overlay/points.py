"""The points of a path: where an object comes through, natively and in a mode, as arrays for the overlay to draw.

Points are (n, 3), in the space of the object's channels, its own delta transforms included; `space_of_object` leads
from there into the world. Frames are those of the Action. No window and no graphics card is needed here.

On a short path, or one that is looked at from afar, ticks would be a solid bar. They stay evenly timed: of a path that
moves too little from tick to tick, only every second, fifth, tenth... is left. Where the object nearly rests even those
are too close to one another, or to a key, and left out. Distances are in pixels at a resolution scale of 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.evaluation.differences import in_betweens
from ...animation.evaluation.sources import KeyedTransform
from ...animation.transforms.sizes import drawn_size
from ...motion import Poses
from ...motion.affine import AffineMaps, turned
from ...motion.quaternions import rotate
from .ghosts import Ghosts
from .parents import Parents

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


class Followed(NamedTuple):
    """Which point of something a path is of, where it is not the origin."""

    moves: bool
    """True if its location counts."""

    stays: np.ndarray
    """The part of its place that does not move, shape (3,)."""

    tip: np.ndarray
    """The point on its own axes, shape (3,)."""

    turned: np.ndarray | None
    """The turn of its rotation, and of the axes with it, in the space of its location: (3, 3), or (n, 3, 3)."""

    def points(self, poses: Poses) -> np.ndarray:
        """Return where the point is at these poses, shape (n, 3)."""
        arms = rotate(poses.quaternions, self.tip)
        if poses.scales is not None:
            arms = poses.scales[:, None] * arms
        return poses.positions * self.moves + self.stays + self.strokes(arms)

    def strokes(self, vectors: np.ndarray) -> np.ndarray:
        """Return what vectors (n, 3) that turn with it are in the space of its location."""
        return vectors if self.turned is None else turned(self.turned, vectors)

    def at(self, indices: np.ndarray) -> Followed:
        """Return the point as it is followed at some of the poses."""
        return self if self.turned is None or self.turned.ndim == 2 else self._replace(turned=self.turned[indices])


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

    def at(self, frame: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return where it is at a frame, natively and in the mode, each of shape (3,). The path holds its ends."""

        def point(line: np.ndarray) -> np.ndarray:
            return np.array([np.interp(frame, self.frames, column) for column in line.T])

        return point(self.native), None if self.desired is None else point(self.desired)


def trace(
    source: KeyedTransform,
    mode: str | None = None,
    tick_step: int = 0,
    axis_length: float = 1.0,
    selected: np.ndarray | None = None,
    followed: Followed | None = None,
    parents: Parents | None = None,
) -> DrawnPath | None:
    """Return the path of a source, None where it has fewer than two keys.

    Parameters
    ----------
    source : Source
    mode : str, optional
        One of `MODE_IDS`, to see what it would do. None for the modes that the segments have.
    tick_step : int
        Frames from tick to tick, which are on multiples of it. 0 for as many as can be read.
    axis_length : float
        Of the axes at the ticks, in the unit of the channels, at scale 1.
    selected : array, shape (n,), optional
        The frames of the keys that are selected.
    followed : Followed, optional
        The point that the path is of, where it is not the origin.
    parents : Parents, optional
        What carries it, for a path in the space of the world.

    Raises
    ------
    ValueError
        Where the keys make no motion.
    """
    if len(source.key_frames) < 2 and source.carried is None:
        return None
    first, last = source.seen_range
    keys = source.keyed_frames
    ticks = tick_frames(first, last, tick_step)
    with_axes = axis_frames(ticks)
    samples = np.unique(np.concatenate((sample_frames(first, last), keys)))
    frames = np.union1d(samples, ticks)
    motion = in_betweens(source, frames, mode)
    on_samples, on_keys, on_ticks, on_axes = (
        np.searchsorted(frames, desired_frames) for desired_frames in (samples, keys, ticks, with_axes)
    )
    is_native = not source.is_live if mode is None else mode == "BLENDER"
    shown = motion.native if is_native else motion.desired
    spaces = None
    if parents is not None:
        spaces, turns = parents.spaces(frames)
        followed = None if followed is None else followed._replace(turned=turns)
    native, desired = (_points(poses, followed, spaces) for poses in (motion.native, motion.desired))
    return DrawnPath(
        frames=samples,
        native=native[on_samples],
        desired=None if is_native else desired[on_samples],
        key_frames=keys,
        keys=native[on_keys],
        selected=np.isin(keys, () if selected is None else selected),
        tick_frames=ticks,
        native_ticks=native[on_ticks],
        desired_ticks=None if is_native else desired[on_ticks],
        axis_frames=with_axes,
        axes=_axes(
            (native if is_native else desired)[on_axes],
            shown[on_axes],
            axis_length,
            None if followed is None else followed.at(on_axes),
            None if spaces is None else spaces[on_axes],
        ),
        in_world=spaces is not None,
    )


def _points(poses: Poses, followed: Followed | None, spaces: AffineMaps | None) -> np.ndarray:
    """Return where the point that a path is of is at poses (n,), in these spaces."""
    points = poses.positions if followed is None else followed.points(poses)
    return points if spaces is None else spaces.at(points)


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


def _axes(
    points: np.ndarray, poses: Poses, length: float, followed: Followed | None, spaces: AffineMaps | None
) -> np.ndarray:
    """Return both ends of the local axes at each pose, from these points on, shape (n, 3, 2, 3)."""
    lengths = np.full(len(poses), length) if poses.scales is None else length * poses.scales
    strokes = lengths[:, None, None] * rotate(poses.quaternions[:, None], np.eye(3))
    for axis in range(3):
        if followed is not None:
            strokes[:, axis] = followed.strokes(strokes[:, axis])
        if spaces is not None:
            strokes[:, axis] = turned(spaces.axes, strokes[:, axis])
    starts = np.broadcast_to(points[:, None], strokes.shape)
    return np.stack((starts, starts + strokes), axis=2)


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


def axis_length_of_object(obj: bpy.types.Object, source: KeyedTransform) -> float:
    """Return how long to draw an object's local axes: half as long as it is. At scale 1,
    where the source has a scale.
    """
    drawn = drawn_size(obj)
    size: np.ndarray = np.full(3, drawn) if drawn else 0.5 * np.ptp(np.array(obj.bound_box), axis=0)
    if not source.uniform_scale:
        size *= np.abs(np.array(obj.scale) * np.array(obj.delta_scale))
    return float(size.max()) or 1.0


def space_of_object(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """Return the matrix from the space of an object's channels into the world, as its parent is on the current frame.

    For a parent that is an object: that one's evaluated matrix, and the inverse at parenting. For a bone, vertices or a
    lattice: what takes the object's evaluated location, rotation and scale to where it is seen, constraints included.
    """
    if obj.parent is None:
        return Matrix.Identity(4)
    if obj.parent_type == "OBJECT":
        return obj.parent.evaluated_get(depsgraph).matrix_world @ obj.matrix_parent_inverse
    evaluated = obj.evaluated_get(depsgraph)
    return evaluated.matrix_world @ evaluated.matrix_basis.inverted_safe()


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
