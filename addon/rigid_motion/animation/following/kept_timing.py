"""Handles for a key inserted on an in-between that keep the timing of the motion unchanged.

Blender gives a key inserted on an F-curve handles that keep the curve unchanged. But the in-between of a mode does not
lie on the F-curves. The progress of a body between two keys comes from all channels together: so here the new handles
of all channels together give the previous timing before and after the new key, and the outer handles are kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import bpy
import numpy as np

from ..actions.channels import key_points
from ..evaluation.components import PART_OF, ROTATION
from ..evaluation.differences import progress_at
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..fcurves.keys import Keys
from ..fcurves.solvers import fit_together, solve_cubics

TIMING_MOMENTS = np.linspace(0.0, 1.0, 41)
"""The times on either side of the key at which timing is compared, 0 to 1."""

IN_TIME = np.array((1.0, 2.0)) / 3.0
"""The times of handles that make a segment a cubic in time."""

MIN_PROGRESS = 1e-6
"""Less progress along a path than this counts as none."""


def nearest_key(fcurve: bpy.types.FCurve, frame: float) -> tuple[int, np.ndarray]:
    """Return the index of the key nearest to a frame, 0 if there is none, and frame and value of all keys, (n, 2)."""
    points = key_points(fcurve)
    return int(np.argmin(np.abs(points[:, 0] - frame))) if len(points) else 0, points


@dataclass(frozen=True, eq=False)
class Insertion:
    """A key inserted with the pose that the motion had there."""

    curves: Mapping[int, bpy.types.FCurve]
    """The channels by row of the component."""

    old: KeyedTransform
    """The source before the insertion."""

    frame: float

    @property
    def segment(self) -> int:
        """The index of the segment that the key divides."""
        return int(np.searchsorted(self.old.key_frames, self.frame)) - 1

    @property
    def is_shaped(self) -> bool:
        """Return whether the key divides a segment of a mode that is shaped by handles."""
        old = self.old
        is_inside = old.key_frames[0] < self.frame < old.key_frames[-1]
        return is_inside and bool(old.has_handles[self.segment]) and old.mode_at(self.frame) != 0

    @property
    def frames(self) -> np.ndarray:
        """The frames of the previous key, the new key and the next key, (3,)."""
        return np.insert(self.old.key_frames[self.segment : self.segment + 2], 1, self.frame)

    @property
    def moments(self) -> np.ndarray:
        """`TIMING_MOMENTS` before the key and then after it, as frames."""
        first, frame, last = self.frames.tolist()
        moments = np.concatenate((first + (frame - first) * TIMING_MOMENTS, frame + (last - frame) * TIMING_MOMENTS))
        # The last frame belongs to the next segment.
        moments[-1] = np.nextafter(last, first)
        return moments

    def keep(self, progress: np.ndarray) -> None:
        """Set handles that give this progress (2, m) at `TIMING_MOMENTS` on either side of the key."""
        filled, curved, linear = set(self.old.filled_rows), [], np.zeros(2)
        for rows, keys in self.old.channels:
            for number, row in enumerate(rows):
                three = _keys_on(self.curves[row], self.frames) if row in filled else None
                if three is not None:
                    weight = 4.0 if self.old.order is None and PART_OF[row] == ROTATION else 1.0
                    shares = weight * np.diff([key.co.y for key in three]) ** 2
                    if three[0].interpolation == "BEZIER":
                        _free_handles(three, keys, number)
                        curved.append((row, three, shares, _divided_handle_times(keys, number, self.frames)))
                    else:
                        linear += shares
        if not curved:
            return
        _, of_all, shares, times = zip(*curved, strict=True)
        for side, total in enumerate(np.sum(shares, axis=0).tolist()):
            begun = progress[side] - progress[side, 0]
            handles = np.tile(IN_TIME[:, None], (len(curved), 1, 2))
            if abs(begun[-1]) >= MIN_PROGRESS and total > 0.0:
                desired = (begun / begun[-1] * (total + linear[side]) - linear[side] * TIMING_MOMENTS) / total
                handles = fit_together(
                    TIMING_MOMENTS, desired, np.array(shares)[:, side] / total, np.array(times)[:, side]
                )
                self._extend_motion(side, of_all, begun[-1], linear[side] / total)
            for three, of_one in zip(of_all, handles, strict=True):
                _set_handles(three[side], three[side + 1], of_one)
        for row, *_ in curved:
            self.curves[row].update()

    def _extend_motion(
        self, side: int, of_all: Iterable[list[bpy.types.Keyframe]], share: float, linear: float
    ) -> None:
        """Extend the motion before the first or after the last key at its former speed, by the outer handles.

        `share` is the fraction of the segment on this side, `linear` the weight of channels without handles relative to
        that of the channels with handles, `of_all`.
        """
        frames, duration = self.frames, float(np.diff(self.frames)[side])
        if not self.old.is_linear or frames[2 * side] != self.old.key_frames[-side]:
            return
        third = duration / 3 if side else -duration / 3
        gone = progress_at([self.old], [frames[2 * side, None] + third])[0][0] - side
        gone = (1.0 + linear) * gone / share - linear * third / duration
        for three in of_all:
            key, change = three[2 * side], three[side + 1].co.y - three[side].co.y
            setattr(key, ("handle_left", "handle_right")[side], (key.co.x + third, key.co.y + gone * change))


def keep_timing(insertions: Iterable[Insertion]) -> None:
    """Set the handles of new keys and of their neighbours, if handles shape the segment."""
    shaped = [inserted for inserted in insertions if inserted.is_shaped]
    if shaped:
        of_all = progress_at([inserted.old for inserted in shaped], [inserted.moments for inserted in shaped])
        for inserted, progress in zip(shaped, of_all, strict=True):
            inserted.keep(progress.reshape(2, -1))


def _keys_on(fcurve: bpy.types.FCurve, frames: np.ndarray) -> list[bpy.types.Keyframe] | None:
    """Return the keys on three frames, if all exist and no other keys lie between them."""
    at, points = nearest_key(fcurve, frames[1])
    beside = slice(max(at - 1, 0), at + 2)
    is_on = len(points[beside]) == 3 and np.abs(points[beside, 0] - frames).max() < SAME_FRAME
    return list(fcurve.keyframe_points[beside]) if is_on else None


def _divided_handle_times(keys: Keys, number: int, frames: np.ndarray) -> np.ndarray:
    """Return the handle times (2, 2) that keep a curve unchanged on either side of the second of three frames.

    Times are from 0 to 1 on either side, or `IN_TIME` if there was no handle on the first or last frame.
    """
    first, last = np.abs(keys.times - frames[[0, 2], None]).argmin(axis=1)
    if (
        keys.left is None
        or keys.right is None
        or np.abs(keys.times[[first, last]] - frames[[0, 2]]).max() >= SAME_FRAME
    ):
        return np.stack((IN_TIME, IN_TIME))
    duration = frames[2] - frames[0]
    p = [0.0, keys.right[number, first, 0] - frames[0], keys.left[number, last, 0] - frames[0], duration]
    p = [float(min(max(time / duration, 0.0), 1.0)) for time in p]
    share = (frames[1] - frames[0]) / duration
    cubic = np.array((3.0 * p[1], 3.0 * (p[2] - 2.0 * p[1]), 1.0 + 3.0 * (p[1] - p[2])))
    t = solve_cubics(np.array((share,)), cubic[:, None])[0]
    # De Casteljau's division.
    q = [a + t * (b - a) for a, b in pairwise(p)]
    r = [a + t * (b - a) for a, b in pairwise(q)]
    return np.array(((q[0] / share, r[0] / share), ((r[1] - share) / (1.0 - share), (q[2] - share) / (1.0 - share))))


def _free_handles(three: list[bpy.types.Keyframe], keys: Keys, number: int) -> None:
    """Free the handles of three keys, and restore the former outer handles of the first and the last key."""
    for key in three:
        key.handle_left_type = key.handle_right_type = "FREE"
    for key, of_keys, side in ((three[0], keys.left, "handle_left"), (three[2], keys.right, "handle_right")):
        at = int(np.argmin(np.abs(keys.times - key.co.x)))
        if of_keys is not None and abs(keys.times[at] - key.co.x) < SAME_FRAME:
            setattr(key, side, of_keys[number, at].tolist())


def _set_handles(first: bpy.types.Keyframe, last: bpy.types.Keyframe, handles: np.ndarray) -> None:
    """Set the handles between two keys, given as those of a segment from (0, 0) to (1, 1)."""
    right, left = (np.array(first.co) + handles * (last.co - first.co)).tolist()
    first.handle_right, last.handle_left = right, left
