"""Known keys: the poses of a stream as they become known one by one, and the motion that they make so far.

What is asked for a moment of the motion is answered with the keys known by then: between two of them as the mode has
it, before the first at rest, and beyond the newest as the last segment goes on, slower and slower. Seconds throughout,
those of the motion by the sender's clock and those at which a key became known by the receiver's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigid_motion.motion import Poses, in_betweens, twists

from .smooth import TWISTS, Reach, between, moved, reach_of

NONE = -1
"""In place of a key where there is none."""


@dataclass(frozen=True, eq=False)
class KnownKeys:
    """n keys that become known in any order."""

    stamps: np.ndarray
    """Where they are in the motion, strictly rising, shape (n,)."""

    poses: Poses
    """Shape (n,), quaternions of length 1."""

    known_from: np.ndarray
    """When each becomes known, shape (n,)."""

    mode: str

    interval: float
    """From one key to the next, as agreed."""

    carry: float
    """The time within which the motion beyond the newest key comes to rest: its speed falls as exp(-t / carry)."""

    twists: np.ndarray | None = None
    """Of the keys, where the mode is `TWISTS`, shape (n, 6)."""

    @cached_property
    def _reach(self) -> Reach:
        return reach_of(self.mode)

    @property
    def _behind(self) -> int:
        """The keys of a window before the two of its segment."""
        return self._reach.before

    @cached_property
    def _arrivals(self) -> tuple[np.ndarray, np.ndarray]:
        """The moments at which keys become known, rising, and the newest key after each."""
        order = np.argsort(self.known_from, kind="stable")
        return self.known_from[order], np.maximum.accumulate(order)

    def windows(self, moments: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The keys that have a say at moments (m,) of the motion, of those known at `now` (m,), rising.

        Returns
        -------
        array of int, shape (m, behind + 2 + ahead)
            The keys behind the segment, its two, those ahead; `NONE` where none is known or needed. Two windows that
            are equal stand for the same motion. `behind` is at least 1, for going on beyond the newest key.
        """
        mode, behind = self._reach, self._behind
        windows = np.full((len(moments), behind + 2 + mode.ahead), NONE)
        arrived, newest_after = self._arrivals
        newest = np.append(newest_after, NONE)[np.searchsorted(arrived, now, side="right") - 1]
        at = np.minimum(np.searchsorted(self.stamps, moments, side="right") - 1, newest)
        first = self._search(at, -1, newest, now)
        second = self._search(np.where(first == NONE, 0, first + 1), 1, newest, now)
        windows[:, behind], windows[:, behind + 1] = first, second
        for column in reversed(range(behind)):
            # Between keys as many as the mode wants; beyond the newest the one that says where it was going.
            wanted = np.where(second == NONE, column == behind - 1, behind - column <= mode.behind)
            start = np.where(wanted, windows[:, column + 1] - 1, NONE)
            windows[:, column] = self._search(start, -1, newest, now)
        for column in range(behind + 2, windows.shape[1]):
            start = np.where((first == NONE) | (windows[:, column - 1] == NONE), NONE, windows[:, column - 1] + 1)
            windows[:, column] = self._search(start, 1, newest, now)
        return windows

    def segments(self, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The two keys in the middle of windows (m, .), of which either may be `NONE`, shape (m,) each."""
        behind = self._behind
        return windows[:, behind], windows[:, behind + 1]

    def nearest(self, moments: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """How far moments (m,) are from the nearest key of their windows (m, .), shape (m,)."""
        distances = np.abs(self.stamps[windows] - moments[:, None])
        return np.where(windows == NONE, np.inf, distances).min(axis=1)

    def _search(self, start: np.ndarray, step: int, newest: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The first key known at `now` from `start` (m,) on, upwards or downwards; `NONE` where there is none."""
        found = np.where((start >= 0) & (start <= newest), start, NONE)
        rows = np.flatnonzero(found != NONE)
        while True:
            rows = rows[self.known_from[found[rows]] > now[rows]]
            if not len(rows):
                return found
            found[rows] += step
            found[rows[found[rows] > newest[rows]]] = NONE
            rows = rows[found[rows] != NONE]

    def poses_at(self, moments: np.ndarray, windows: np.ndarray) -> Poses:
        """The poses at moments (m,), each by its own window (m, .), of which none is empty."""
        positions, quaternions = np.empty((len(moments), 3)), np.empty((len(moments), 4))

        def fill(rows: np.ndarray, poses: Poses) -> None:
            positions[rows], quaternions[rows] = poses.positions, poses.quaternions

        behind = self._behind
        first, second = self.segments(windows)
        between_keys = (first != NONE) & (second != NONE)
        resting, going_on = np.flatnonzero(first == NONE), np.flatnonzero(second == NONE)
        fill(resting, self.poses[second[resting]])
        if len(going_on):
            fill(going_on, self._beyond(moments[going_on], windows[going_on, behind - 1], first[going_on]))
        if self.mode == TWISTS:
            if between_keys.any():
                fill(np.flatnonzero(between_keys), self._smooth(moments, first, second, between_keys))
            return Poses(positions, quaternions)
        # Windows of one shape, and of those the ones that come one after another, are worked out together.
        shapes = np.count_nonzero(windows[:, :behind] != NONE, axis=1), np.count_nonzero(windows != NONE, axis=1)
        for before, keys in {*zip(*(shape[between_keys].tolist() for shape in shapes), strict=True)}:
            rows = np.flatnonzero(between_keys & (shapes[0] == before) & (shapes[1] == keys))
            own = windows[rows, behind - before : behind - before + keys]
            runs = np.flatnonzero(np.append(True, (own[1:] != own[:-1]).any(axis=1)))
            own, lengths = own[runs], np.diff(np.append(runs, len(rows)))
            counts = np.zeros((len(own), keys - 1), dtype=np.int64)
            counts[:, before] = lengths
            begin, end = self.stamps[first[rows]], self.stamps[second[rows]]
            progress = (moments[rows] - begin) / (end - begin)
            fill(rows, in_betweens(self.stamps[own], self.poses[own], counts, progress, self.mode))
        return Poses(positions, quaternions)

    def _smooth(self, moments: np.ndarray, first: np.ndarray, second: np.ndarray, rows: np.ndarray) -> Poses:
        """Between keys that have twists, at those of the moments (m,) that are chosen by `rows`, bool of shape (m,)."""
        first, second = first[rows], second[rows]
        durations = self.stamps[second] - self.stamps[first]
        progress = (moments[rows] - self.stamps[first]) / durations
        return between(
            self.poses[first], self.poses[second], self.twists[first], self.twists[second], durations, progress
        )

    def _beyond(self, moments: np.ndarray, before: np.ndarray, last: np.ndarray) -> Poses:
        """How the motion goes on after the keys `last` (m,), where it comes from keys `before` or from `NONE`."""
        start, passed = self.poses[last], moments - self.stamps[last]
        going = self.carry * -np.expm1(-passed / self.carry) if self.carry > 0.0 else np.zeros_like(passed)
        if self.mode == TWISTS:
            return moved(start, self.twists[last].T * going)
        origin = self.poses[np.where(before == NONE, last, before)]
        way = twists.between(origin.positions, origin.quaternions, start.positions, start.quaternions)
        # Keys that come sooner than agreed are not taken for a faster motion.
        duration = np.maximum(self.stamps[last] - self.stamps[np.where(before == NONE, last, before)], self.interval)
        return moved(start, way * (going / duration))
