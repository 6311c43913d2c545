"""Handles for a key that was inserted on an in-between, with which the motion goes on as it did.

Blender gives a key that is inserted on an F-curve such handles that the curve stays as it was. A mode's in-between does
not lie on the F-curves. How far a body has come between two keys is what all channels make of it together: so here they
get the timing that the motion had, before the new key and behind it, and the handles beside it are kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import bpy
import numpy as np

from ..compute.differences import progress_at
from ..compute.sources import DEPENDS_ON_KEYS, SAME_FRAME, Source
from ..curves import Keys
from ..curves.fitting import fit_together
from ..curves.solvers import bezier_cubics, solve_cubics

MOMENTS = np.linspace(0.0, 1.0, 41)
"""Of either side, at which the timing is looked at."""

QUATERNION = 4.0
"""What the square of a quaternion's change counts for: it moves by half of the angle that the object turns."""

STILL = 1e-6
"""Progress along a path that is none."""


@dataclass(frozen=True)
class _Channel:
    """A channel that is not linear, with a new key, and with keys on both frames beside it."""

    keys: list[bpy.types.Keyframe]
    """The one before, the new one and the one behind."""

    outer: np.ndarray
    """The handles before the first of them and behind the last, shape (2, 2)."""

    native: np.ndarray
    """Those between, with which its curve would stay as it was: before the new key and behind it, shape (2, 2, 2)."""

    weight: float
    """What the square of its way counts for in that of all channels."""

    def way(self, side: int) -> np.ndarray:
        """From one key to the next, before the new one or behind it, in frames and value."""
        return np.array(self.keys[side + 1].co) - np.array(self.keys[side].co)

    def times(self, side: int) -> np.ndarray:
        """The times of the native handles there, from 0 to 1, shape (2,)."""
        return np.clip((self.native[side, :, 0] - self.keys[side].co.x) / self.way(side)[0], 0.0, 1.0)

    def set_handles(self, inner: Sequence[np.ndarray]) -> None:
        """Set these before the new key and behind it, (2, 2) each, and the outer ones as they were."""
        before, new, behind = self.keys
        for key in self.keys:
            key.handle_left_type = key.handle_right_type = "FREE"
        before.handle_left, behind.handle_right = self.outer
        (before.handle_right, new.handle_left), (new.handle_right, behind.handle_left) = inner


def nearest_key(fcurve: bpy.types.FCurve, frame: float) -> tuple[int, np.ndarray]:
    """Return the number of the key that is nearest to a frame, 0 where there is none, and the times of all (n,)."""
    points = np.empty(2 * len(fcurve.keyframe_points), np.float32)
    fcurve.keyframe_points.foreach_get("co", points)
    times = points[::2]
    return int(np.abs(times - frame).argmin()) if len(times) else 0, times


def mark_breakdown(curves: Iterable[bpy.types.FCurve], old: Source, frame: float) -> None:
    """Make a new key a breakdown, where the path would be another one with a key more that shapes it."""
    if old.cyclic is None and old.mode_at(frame) in DEPENDS_ON_KEYS:
        for fcurve in curves:
            number, times = nearest_key(fcurve, frame)
            if len(times) and abs(times[number] - frame) < SAME_FRAME:
                fcurve.keyframe_points[number].type = "BREAKDOWN"


@dataclass(frozen=True)
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
    def moments(self) -> np.ndarray:
        """`MOMENTS` before the key and then behind it, as frames."""
        first, last = self.old.key_frames[self.segment : self.segment + 2]
        moments = np.concatenate((first + (self.frame - first) * MOMENTS, self.frame + (last - self.frame) * MOMENTS))
        # On the last frame the next segment begins.
        moments[-1] = np.nextafter(last, first)
        return moments


def keep_timing(insertions: Iterable[Insertion]) -> None:
    """Set the handles of new keys and of those beside them, where handles shape the segment."""
    shaped = [inserted for inserted in insertions if inserted.old.has_handles[inserted.segment]]
    progress = progress_at([inserted.old for inserted in shaped], [inserted.moments for inserted in shaped])
    for inserted, along in zip(shaped, progress, strict=True):
        _keep_timing(inserted, along.reshape(2, -1))


def _keep_timing(inserted: Insertion, progress: np.ndarray) -> None:
    """The same for one of them, from its progress at `MOMENTS` on either side, shape (2, m)."""
    old, curves = inserted.old, inserted.curves
    frames = np.insert(old.key_frames[inserted.segment : inserted.segment + 2], 1, inserted.frame)
    channels, others = [], []
    for rows, keys in old.channels:
        outer, native = _handles_of(keys, frames) if keys.left is not None else (None, None)
        for number, row in enumerate(rows):
            weight = QUATERNION if old.order is None and 3 <= row < 7 else 1.0
            beside = _keys_on(curves[row], frames)
            if beside is None or beside[0].interpolation != "BEZIER":
                others.append((row, weight, beside))
                continue
            channel = _Channel(beside, outer[number], native[number], weight)
            if row in old.filled_rows:
                channels.append(channel)
            else:
                channel.set_handles(channel.native)
                others.append((row, weight, None))
    done = np.zeros((2, len(MOMENTS)))
    values = old.values_at(inserted.moments).reshape(-1, 2, len(MOMENTS)) if others else None
    for row, weight, beside in others:
        if beside is not None:
            values[row] = [np.interp(MOMENTS, (0, 1), (key.co.y, after.co.y)) for key, after in pairwise(beside)]
        way = values[row] - values[row, :, :1]
        done += weight * way[:, -1:] * way
    fitted = [_fitted(channels, side, progress[side], done[side]) for side in (0, 1)]
    for number, channel in enumerate(channels):
        channel.set_handles(
            [
                np.array(channel.keys[side].co) + handles[number] * channel.way(side)
                for side, handles in enumerate(fitted)
            ]
        )
    for fcurve in curves.values():
        fcurve.update()


def _keys_on(fcurve: bpy.types.FCurve, frames: Sequence[float]) -> list[bpy.types.Keyframe] | None:
    """The keys on three frames, if there are any and none between them."""
    at, times = nearest_key(fcurve, frames[1])
    beside = slice(max(at - 1, 0), at + 2)
    is_beside = len(times[beside]) == 3 and np.abs(times[beside] - frames).max() < SAME_FRAME
    return fcurve.keyframe_points[beside] if is_beside else None


def _handles_of(keys: Keys, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what `_Channel` has as `outer` and `native` of c channels, from a new key between two frames."""
    before, behind = (int(np.argmin(np.abs(keys.times - frame))) for frame in frames[::2])
    outer = np.stack((keys.left[:, before], keys.right[:, behind]), axis=1)
    start, end = keys.points[:, before], keys.points[:, behind]
    first, second, third = bezier_cubics(start, keys.right[:, before], keys.left[:, behind], end)
    start, duration = start.astype(np.float64), keys.times[behind] - keys.times[before]
    at = np.full(len(start), (frames[1] - keys.times[before]) / duration)
    t = solve_cubics(at, np.stack((first, second, third))[..., 0] / duration)[:, None]
    # The control points of the cubic, and those of both parts by de Casteljau.
    p = [start, start + first / 3.0, start + (2.0 * first + second) / 3.0, start + first + second + third]
    q = [a + t * (b - a) for a, b in pairwise(p)]
    r = [a + t * (b - a) for a, b in pairwise(q)]
    return outer, np.stack((np.stack((q[0], r[0]), axis=1), np.stack((r[1], q[2]), axis=1)), axis=1)


def _fitted(channels: Sequence[_Channel], side: int, progress: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Return the handles (c, 2, 2) of channels on one side of a new key, where that is a segment of unit size.

    Parameters
    ----------
    channels, side
    progress : array, shape (m,)
        What the motion has there at `MOMENTS`.
    done : array, shape (m,)
        What the other channels do of the way by then, as its part of the square of all.
    """
    shares = np.array([channel.weight * channel.way(side)[1] ** 2 for channel in channels])
    way, sum_of_shares = progress[-1] - progress[0], shares.sum()
    if abs(way) < STILL or sum_of_shares == 0.0:
        return np.repeat((((1.0, 1.0), (2.0, 2.0)),), len(channels), axis=0) / 3.0
    wanted = (progress - progress[0]) / way * (done[-1] + sum_of_shares) - done
    native = np.stack([channel.times(side) for channel in channels])
    return fit_together(MOMENTS, wanted / sum_of_shares, shares / sum_of_shares, native)
