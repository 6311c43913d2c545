"""Rests of a body relative to a holder: stretches of frames on which one pose can replace all its poses.

Errors are shell errors, see `rigid_motion.motion.shell_error`. Places are indices of frames, counted from 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...motion import Poses, shell_error
from ...motion.poses import inverse, placed
from ...motion.quaternions import from_matrices, matrices

MINIMAX_STEPS = 48
"""The number of steps towards the pose with the smallest maximum error, which is then a few percent from the best."""

MAX_EXTENSION_ROUNDS = 6
"""The most rounds of extending a stretch as far as its best pose allows."""

TIGHTER_ERROR_RATIO = 0.5
"""Reducing the error to this fraction is worth losing a few frames at the ends of a stretch."""

MAX_FRAMES_LOST_RATIO = 0.1
"""The largest fraction of frames to lose for that; two frames may always be lost."""


class RestStretch(NamedTuple):
    """A stretch on which a body is at rest."""

    first: int
    last: int
    pose: Poses
    """The pose that replaces its poses, shape ()."""

    largest: float
    """The largest error of that pose on any frame."""

    @property
    def frames(self) -> int:
        """The number of frames."""
        return self.last - self.first + 1


class BodyPoses:
    """A body with poses (m,) in the space of a holder or of its channels.

    Each pose is also a point: its origin, and its axes with the length of the radius over the square root of 2. The
    distance of two points is at most their shell error, which is at most the square root of 2 times as large.
    """

    def __init__(self, poses: Poses, radius: float) -> None:
        self.poses, self.radius = poses, radius
        axes = np.moveaxis(matrices(poses.quaternions), -1, 0).reshape(-1, 9)
        self._axis_length = radius / np.sqrt(2.0)
        self.points = np.column_stack((poses.positions, axes * self._axis_length))

    def errors(self, first: int, last: int, pose: Poses) -> np.ndarray:
        """Return the errors of a pose () against the body's poses from one place to another, shape (n,)."""
        return shell_error(self.poses[first : last + 1], pose, self.radius)

    def best_pose(self, first: int, last: int) -> Poses:
        """Return the pose () with nearly the smallest maximum error there, measured by distances of points.

        Source: Bădoiu and Clarkson, "Smaller core-sets for balls", 2003: from the middle, ever smaller steps towards
        the farthest point.
        """
        points = self.points[first : last + 1]
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        best, smallest = center, np.inf
        for step in range(MINIMAX_STEPS):
            apart = points - center
            squared = np.einsum("ij,ij->i", apart, apart)
            worst = int(np.argmax(squared))
            if squared[worst] < smallest:
                best, smallest = center, squared[worst]
            center = center + apart[worst] / (step + 4.0)
        left, _, right = np.linalg.svd(best[3:].reshape(3, 3))
        turn = left @ np.diag((1.0, 1.0, np.linalg.det(left @ right))) @ right
        return Poses(best[:3], from_matrices(turn))

    def rests(
        self, tolerance: float, free: np.ndarray, least: int, anyway: np.ndarray | None = None
    ) -> list[RestStretch]:
        """Return the stretches of at least `least` free frames (m,) on which the body is at rest, the longest first.

        Stretches do not overlap. Each may lose a few frames at its ends for a smaller error. `anyway` (m,) are the last
        places up to which the body rests in something else, see `reached`; only longer stretches are tried.
        """
        last = self.reached(tolerance, free)
        starts = np.arange(len(last))
        counts = np.where(free if anyway is None else free & (last > anyway), last - starts + 1, 0)
        result: list[RestStretch] = []
        while len(counts) and counts[first := int(np.argmax(counts))] >= least:
            rest = self._rest_within(first, int(last[first]), tolerance, least)
            if rest is None:
                counts[first : first + (least + 1) // 2] = 0
                continue
            result.append(rest)
            last = np.where(starts < rest.first, np.minimum(last, rest.first - 1), last)
            counts = np.minimum(counts, last - starts + 1)
            counts[rest.first : rest.last + 1] = 0
        return result

    def reached(self, tolerance: float, free: np.ndarray) -> np.ndarray:
        """Return the last place (m,) up to which the body may be at rest from each place on, on free frames (m,).

        Two poses within the tolerance of a third pose differ by at most twice the tolerance in each number of their
        points.
        """
        # This places a frame that is not free, and all later frames, too far away.
        points = np.column_stack((self.points, 4.0 * tolerance * np.cumsum(~free)))
        count, lows, highs = len(points), [points], [points]
        while 2 ** len(lows) <= count:
            step = 2 ** (len(lows) - 1)
            lows.append(np.minimum(lows[-1][:-step], lows[-1][step:]))
            highs.append(np.maximum(highs[-1][:-step], highs[-1][step:]))
        at, low, high = np.arange(count), points.copy(), points.copy()
        for level in range(len(lows) - 1, -1, -1):
            # Try to extend by two to the power of the level.
            place = np.minimum(at + 1, len(lows[level]) - 1)
            lower, higher = np.minimum(low, lows[level][place]), np.maximum(high, highs[level][place])
            fits = (at + 1 + 2**level <= count) & (higher - lower <= 2.0 * tolerance).all(axis=1)
            at = np.where(fits, at + 2**level, at)
            low, high = np.where(fits[:, None], lower, low), np.where(fits[:, None], higher, high)
        return at

    def _rest_within(self, first: int, last: int, tolerance: float, least: int) -> RestStretch | None:
        """Return a long stretch of these places on which the body is at rest; None if none is long enough."""
        rest = self._longest_rest(first, last, tolerance)
        if rest.frames < least:
            return None
        while rest.largest > 0.0:
            tighter = self._longest_rest(rest.first, rest.last, TIGHTER_ERROR_RATIO * rest.largest)
            if tighter.frames < max(least, rest.frames - max(2, int(MAX_FRAMES_LOST_RATIO * rest.frames))):
                break
            rest = tighter
        return rest

    def _longest_rest(self, first: int, last: int, tolerance: float) -> RestStretch:
        """Return the longest stretch found in these places on which the body is at rest. It may be a single frame."""
        begin, end = first, last
        found = RestStretch(first, first, self.poses[first], 0.0)
        for _ in range(MAX_EXTENSION_ROUNDS):
            pose = self.best_pose(begin, end)
            errors = self.errors(first, last, pose)
            edges = np.flatnonzero(np.diff(np.concatenate(([False], errors <= tolerance, [False]))))
            if not len(edges):
                # Not a single frame fits: try the middle of the stretch.
                begin, end = begin + (end - begin) // 4, end - (end - begin) // 4
                continue
            begins, ends = edges[::2], edges[1::2] - 1
            longest = int(np.argmax(ends - begins))
            near = slice(begins[longest], ends[longest] + 1)
            rest = RestStretch(first + int(near.start), first + int(near.stop) - 1, pose, float(errors[near].max()))
            found = max(found, rest, key=lambda rest: (rest.frames, -rest.largest))
            if (rest.first, rest.last) == (begin, end):
                break
            begin, end = rest.first, rest.last
        return found

    def moves(self, rest: RestStretch, distance: float) -> bool:
        """Return whether the body moves by more than a distance here during its rest in something else."""
        pose = self.best_pose(rest.first, rest.last)
        return bool(self.errors(rest.first, rest.last, pose).max() > distance)


def relative(holder: Poses, poses: Poses) -> Poses:
    """Return poses (m,) relative to those of a holder (m,)."""
    return placed(inverse(holder), poses)
