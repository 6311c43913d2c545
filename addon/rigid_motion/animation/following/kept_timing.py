"""Handles for a key that was inserted on an in-between, with which the motion goes on as it did.

Blender gives a key that is inserted on an F-curve such handles that the curve stays as it was. A mode's in-between does
not lie on the F-curves. How far a body has come between two keys is what all channels make of it together: so here they
get the timing that the motion had, before the new key and behind it, and the handles beside these are kept.
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
"""Moments of either side, at which the timing is looked at."""

IN_TIME = np.array((1.0, 2.0)) / 3.0
"""The times of handles with which a segment is a cubic in time."""

MIN_PROGRESS = 1e-6
"""Progress along a path that is none."""


def nearest_key(fcurve: bpy.types.FCurve, frame: float) -> tuple[int, np.ndarray]:
    """Return the number of the key nearest to a frame, 0 where there is none, and frame and value of all, (n, 2)."""
    points = key_points(fcurve)
    return int(np.argmin(np.abs(points[:, 0] - frame))) if len(points) else 0, points


@dataclass(frozen=True, eq=False)
class Insertion:
    """A key that was inserted of the motion as it was."""

    curves: Mapping[int, bpy.types.FCurve]
    """The channels by the rows of their components."""

    old: KeyedTransform
    """As it was without the key."""

    frame: float

    @property
    def segment(self) -> int:
        """The number of the segment that it divides."""
        return int(np.searchsorted(self.old.key_frames, self.frame)) - 1

    @property
    def is_shaped(self) -> bool:
        """Return whether handles shape the segment that it divides, if it divides one of a mode."""
        old = self.old
        is_inside = old.key_frames[0] < self.frame < old.key_frames[-1]
        return is_inside and bool(old.has_handles[self.segment]) and old.mode_at(self.frame) != 0

    @property
    def frames(self) -> np.ndarray:
        """Those of the key before it, its own and that of the key behind it, (3,)."""
        return np.insert(self.old.key_frames[self.segment : self.segment + 2], 1, self.frame)

    @property
    def moments(self) -> np.ndarray:
        """`TIMING_MOMENTS` before the key and then behind it, as frames."""
        first, frame, last = self.frames.tolist()
        moments = np.concatenate((first + (frame - first) * TIMING_MOMENTS, frame + (last - frame) * TIMING_MOMENTS))
        # On the last frame the next segment begins.
        moments[-1] = np.nextafter(last, first)
        return moments

    def keep(self, progress: np.ndarray) -> None:
        """Set the handles with which the progress at `TIMING_MOMENTS` on either side is this again, (2, m)."""
        filled, curved, linear = set(self.old.filled_rows), [], np.zeros(2)
        for rows, keys in self.old.channels:
            for number, row in enumerate(rows):
                three = _keys_on(self.curves[row], self.frames) if row in filled else None
                if three is not None:
                    weight = 4.0 if self.old.order is None and PART_OF[row] == ROTATION else 1.0
                    shares = weight * np.diff([key.co.y for key in three]) ** 2
                    if three[0].interpolation == "BEZIER":
                        _free(three, keys, number)
                        curved.append((row, three, shares, _divided(keys, number, self.frames)))
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
                self._go_on(side, of_all, begun[-1], linear[side] / total)
            for three, of_one in zip(of_all, handles, strict=True):
                _set_handles(three[side], three[side + 1], of_one)
        for row, *_ in curved:
            self.curves[row].update()

    def _go_on(self, side: int, of_all: Iterable[list[bpy.types.Keyframe]], share: float, linear: float) -> None:
        """Have it go on before its first key or behind its last one at the speed that it had, by handles outside.

        `share` is the part of the segment on this side, and `linear` that of channels without handles to that of those
        which have some, `of_all`.
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
    """Set the handles of new keys and of those beside them, where handles shape the segment."""
    shaped = [inserted for inserted in insertions if inserted.is_shaped]
    if shaped:
        of_all = progress_at([inserted.old for inserted in shaped], [inserted.moments for inserted in shaped])
        for inserted, progress in zip(shaped, of_all, strict=True):
            inserted.keep(progress.reshape(2, -1))


def _keys_on(fcurve: bpy.types.FCurve, frames: np.ndarray) -> list[bpy.types.Keyframe] | None:
    """Return the keys on three frames, if there are any and none between them."""
    at, points = nearest_key(fcurve, frames[1])
    beside = slice(max(at - 1, 0), at + 2)
    is_on = len(points[beside]) == 3 and np.abs(points[beside, 0] - frames).max() < SAME_FRAME
    return list(fcurve.keyframe_points[beside]) if is_on else None


def _divided(keys: Keys, number: int, frames: np.ndarray) -> np.ndarray:
    """Return the times of handles (2, 2) with which a curve would be as it was on either side of the second frame.

    From 0 to 1 on either side, `IN_TIME` where there was no handle on the first frame or on the last.
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
    # By de Casteljau.
    q = [a + t * (b - a) for a, b in pairwise(p)]
    r = [a + t * (b - a) for a, b in pairwise(q)]
    return np.array(((q[0] / share, r[0] / share), ((r[1] - share) / (1.0 - share), (q[2] - share) / (1.0 - share))))


def _free(three: list[bpy.types.Keyframe], keys: Keys, number: int) -> None:
    """Let three keys have the handles that they had, on the sides that they have in common with others."""
    for key in three:
        key.handle_left_type = key.handle_right_type = "FREE"
    for key, of_keys, side in ((three[0], keys.left, "handle_left"), (three[2], keys.right, "handle_right")):
        at = int(np.argmin(np.abs(keys.times - key.co.x)))
        if of_keys is not None and abs(keys.times[at] - key.co.x) < SAME_FRAME:
            setattr(key, side, of_keys[number, at].tolist())


def _set_handles(first: bpy.types.Keyframe, last: bpy.types.Keyframe, handles: np.ndarray) -> None:
    """Set the handles between two keys to those of a segment from (0, 0) to (1, 1)."""
    right, left = (np.array(first.co) + handles * (last.co - first.co)).tolist()
    first.handle_right, last.handle_left = right, left
