"""Handles for a key that was inserted on an in-between, with which the motion goes on as it did.

Blender gives a key that is inserted on an F-curve such handles that the curve stays as it was. A mode's in-between does
not lie on the F-curves. How far a body has come between two keys is what all channels make of it together: so here they
get the timing that the motion had, before the new key and behind it, and the handles beside it are kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import bpy
import numpy as np

from ..actions.channels import key_points
from ..evaluation.components import PART_OF, ROTATION
from ..evaluation.differences import progress_at
from ..evaluation.sources import SAME_FRAME, Source, values_of
from ..fcurves.solvers import GOOD, bezier_cubics, cubics_in_time, fit_together, solve_cubics

MOMENTS = np.linspace(0.0, 1.0, 41)
"""Moments of either side, at which the timing is looked at."""

QUATERNION = 4.0
"""The weight of the square of a quaternion's change: it moves by half of the angle that the object turns."""

STILL = 1e-6
"""Progress along a path that is none."""


@dataclass(frozen=True)
class _Channels:
    """c channels of several insertions that are not linear, with a new key, and with keys on both frames beside it."""

    owners: np.ndarray
    """The number of the insertion of each, shape (c,)."""

    keys: list[list[bpy.types.Keyframe]]
    """The one before, the new one and the one behind, of each."""

    points: np.ndarray
    """The frames and values of these, shape (c, 3, 2)."""

    outer: np.ndarray
    """The handles before the first of them and behind the last, shape (c, 2, 2)."""

    native: np.ndarray
    """Handles between with which curves would stay as they were, before and behind the new key, (c, 2, 2, 2)."""

    weights: np.ndarray
    """The weight of the square of its way in that of all channels, 0 where a curve is to stay as it was, (c,)."""

    @cached_property
    def ways(self) -> np.ndarray:
        """From one key to the next, before the new one and behind it, in frames and value, shape (c, 2, 2)."""
        return np.diff(self.points, axis=1)

    @cached_property
    def shares(self) -> np.ndarray:
        """Return what each counts for before the new key and behind it, shape (c, 2)."""
        return self.weights[:, None] * self.ways[..., 1] ** 2

    def times(self, chosen: np.ndarray, side: int) -> np.ndarray:
        """Return the times of the native handles of some on one side, from 0 to 1, shape (k, 2)."""
        begun = self.native[chosen, side, :, 0] - self.points[chosen, side, 0, None]
        return np.clip(begun / self.ways[chosen, side, :1], 0.0, 1.0)

    def set_handles(self, fitted: np.ndarray) -> None:
        """Set handles (c, 2, 2, 2) of segments of unit size, or those of what stays as it was, and the outer ones."""
        inner = self.points[:, :2, None] + fitted * self.ways[:, :, None]
        inner = np.where(self.weights[:, None, None, None] > 0.0, inner, self.native)
        for keys, outer, handles in zip(self.keys, self.outer.tolist(), inner.tolist(), strict=True):
            before, new, behind = keys
            for key in keys:
                key.handle_left_type = key.handle_right_type = "FREE"
            before.handle_left, behind.handle_right = outer
            (before.handle_right, new.handle_left), (new.handle_right, behind.handle_left) = handles


def nearest_key(fcurve: bpy.types.FCurve, frame: float) -> tuple[int, np.ndarray]:
    """Return the number of the key nearest to a frame, 0 where there is none, and frame and value of all, (n, 2)."""
    points = key_points(fcurve)
    return int(np.abs(points[:, 0] - frame).argmin()) if len(points) else 0, points


@dataclass(frozen=True, eq=False)
class Insertion:
    """A key that was inserted of the motion as it was."""

    curves: Mapping[int, bpy.types.FCurve]
    """The channels by the rows of their components."""

    old: Source
    """As it was without the key."""

    frame: float

    @property
    def segment(self) -> int:
        """The number of the segment that it divides."""
        return int(np.searchsorted(self.old.key_frames, self.frame)) - 1

    @property
    def ends(self) -> list[float]:
        """The frames that this begins and ends on."""
        return self.old.key_frames[self.segment : self.segment + 2].tolist()

    @property
    def moments(self) -> np.ndarray:
        """`MOMENTS` before the key and then behind it, as frames."""
        first, last = self.ends
        moments = np.concatenate((first + (self.frame - first) * MOMENTS, self.frame + (last - self.frame) * MOMENTS))
        # On the last frame the next segment begins.
        moments[-1] = np.nextafter(last, first)
        return moments


def keep_timing(insertions: Iterable[Insertion]) -> None:
    """Set the handles of new keys and of those beside them, where handles shape the segment."""
    shaped = [inserted for inserted in insertions if inserted.old.has_handles[inserted.segment]]
    if not shaped:
        return
    sources, moments = [inserted.old for inserted in shaped], [inserted.moments for inserted in shaped]
    progress = np.reshape(progress_at(sources, moments), (-1, 2, len(MOMENTS)))
    channels, others = _channels_of(shaped)
    if channels is not None:
        channels.set_handles(_fitted(channels, progress, _done_by(others, shaped)))
    for inserted in shaped:
        for fcurve in inserted.curves.values():
            fcurve.update()


Other = tuple[int, int, np.ndarray | None]
"""Something else that does a part of the way: the number of an insertion, the row of a component, and frame and value
of three keys (3, 2) between which it is linear."""


def _channels_of(insertions: Sequence[Insertion]) -> tuple[_Channels | None, list[Other]]:
    """Return the channels whose handles are set, if there are any, and what else does a part of the way."""
    result, handles, others = [], [], []
    for owner, inserted in enumerate(insertions):
        old, filled = inserted.old, inserted.old.filled_rows
        first, last = inserted.ends
        frames = np.array((first, inserted.frame, last))
        for rows, keys in old.channels:
            chosen = []
            for number, row in enumerate(rows):
                beside, points = _keys_on(inserted.curves[row], frames)
                has_handles = keys.left is not None and beside is not None and beside[0].interpolation == "BEZIER"
                if has_handles:
                    chosen.append(number)
                    result.append((owner, beside, points, _weight(old, row) if row in filled else 0.0))
                if not has_handles or row not in filled:
                    others.append((owner, row, None if has_handles else points))
            if chosen:
                before, behind = (int(np.abs(keys.times - frame).argmin()) for frame in (first, last))
                ends = [(side[chosen, before], side[chosen, behind]) for side in (keys.points, keys.left, keys.right)]
                handles.append((*itertools.chain(*ends), np.full(len(chosen), inserted.frame)))
    if not result:
        return None, others
    owners, beside, points, weights = zip(*result, strict=True)
    start, end, outer_left, left, right, outer_right, frames = map(np.concatenate, zip(*handles, strict=True))
    outer, native = np.stack((outer_left, outer_right), axis=1), _divided(start, right, left, end, frames)
    return _Channels(np.array(owners), list(beside), np.stack(points), outer, native, np.array(weights)), others


def _weight(source: Source, row: int) -> float:
    return QUATERNION if source.order is None and PART_OF[row] == ROTATION else 1.0


def _keys_on(
    fcurve: bpy.types.FCurve, frames: np.ndarray
) -> tuple[list[bpy.types.Keyframe], np.ndarray] | tuple[None, None]:
    """Return the keys on three frames, and frame and value of each (3, 2), if there are any and none between them."""
    at, all_points = nearest_key(fcurve, frames[1])
    beside = slice(max(at - 1, 0), at + 2)
    points = all_points[beside].astype(np.float64)
    if len(points) < 3 or np.abs(points[:, 0] - frames).max() >= SAME_FRAME:
        return None, None
    return fcurve.keyframe_points[beside], points


def _divided(start: np.ndarray, right: np.ndarray, left: np.ndarray, end: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the inner handles of both parts (c, 2, 2, 2) that Bezier curves are divided into on a frame of each, (c,).

    The curves run from `start` to `end` by the handles `right` and `left`, (c, 2).
    """
    first, second, third = bezier_cubics(start, right, left, end)
    start, duration = start.astype(np.float64), end[:, 0].astype(np.float64) - start[:, 0]
    t = solve_cubics((frames - start[:, 0]) / duration, np.stack((first, second, third))[..., 0] / duration)[:, None]
    # The control points of the cubic, and those of both parts by de Casteljau.
    p = [start, start + first / 3.0, start + (2.0 * first + second) / 3.0, start + first + second + third]
    q = [a + t * (b - a) for a, b in pairwise(p)]
    r = [a + t * (b - a) for a, b in pairwise(q)]
    return np.stack((np.stack((q[0], r[0]), axis=1), np.stack((r[1], q[2]), axis=1)), axis=1)


def _done_by(others: Sequence[Other], insertions: Sequence[Insertion]) -> np.ndarray:
    """Return what these do of the way at `MOMENTS` on either side of each insertion (k, 2, m), as in `_Channels`."""
    done = np.zeros((len(insertions), 2, len(MOMENTS)))
    asked = [insertions[owner] for owner in dict.fromkeys(owner for owner, _, points in others if points is None)]
    result = values_of([inserted.old for inserted in asked], [inserted.moments for inserted in asked])
    values_in = dict(zip(asked, result, strict=True))
    for owner, row, points in others:
        inserted = insertions[owner]
        if points is None:
            values = values_in[inserted][row].reshape(2, -1)
        else:
            values = points[:2, 1, None] + np.diff(points[:, 1])[:, None] * MOMENTS
        way = values - values[:, :1]
        done[owner] += _weight(inserted.old, row) * way[:, -1:] * way
    return done


def _fitted(channels: _Channels, progress: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Return the handles (c, 2, 2, 2) before new keys and behind them, where these segments are of unit size.

    Parameters
    ----------
    channels
    progress : array, shape (k, 2, m)
        What the motion of each insertion has at `MOMENTS`.
    done : array, shape (k, 2, m)
        What the other channels do of the way by then, as its part of the square of all.
    """
    sums = np.zeros(progress.shape[:2])
    np.add.at(sums, channels.owners, channels.shares)
    begun = progress - progress[..., :1]
    moves = (np.abs(begun[..., -1]) >= STILL) & (sums > 0.0)
    way, total = np.where(moves, (begun[..., -1], sums), 1.0)
    desired = (begun / way[..., None] * (done[..., -1] + total)[..., None] - done) / total[..., None]
    handles, errors = cubics_in_time(MOMENTS, desired)
    handles[~moves] = np.array(((1.0, 1.0), (2.0, 2.0))) / 3.0
    result = handles[channels.owners]
    for owner, side in np.argwhere(moves & (errors >= GOOD)).tolist():
        chosen = np.flatnonzero((channels.owners == owner) & (channels.weights > 0.0))
        shares = channels.shares[chosen, side] / sums[owner, side]
        result[chosen, side] = fit_together(MOMENTS, desired[owner, side], shares, channels.times(chosen, side))
    return result
