"""Where a body is at rest in something: stretches of frames on which one pose is as good as those that it has there.

Errors are shell errors, see `rigid_motion.motion.shell_error`. Places are those of frames, counted from 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...motion import Poses, shell_error
from ...motion.poses import inverse, placed
from ...motion.quaternions import from_matrices, matrices

MINIMAX_STEPS = 48
"""Steps towards the pose with the smallest largest error, which is then a few hundredths from the best one."""

MAX_EXTENSION_ROUNDS = 6
"""So often a stretch is made as long as the pose allows that is the best one of it."""

TIGHTER_ERROR_RATIO = 0.5
"""The share of an error that is worth a few frames at the ends of a stretch."""

MAX_FRAMES_LOST_RATIO = 0.1
"""The share of the frames that may be given up for that, and at least two."""


class RestStretch(NamedTuple):
    """A stretch on which something is at rest."""

    first: int
    last: int
    pose: Poses
    """The one that it has instead, shape ()."""

    largest: float
    """The largest error of that on any frame."""

    @property
    def frames(self) -> int:
        """On how many frames that is."""
        return self.last - self.first + 1


class BodyPoses:
    """A body with poses (m,) in something.

    Each pose is also a point: its origin, and its axes as long as the radius over the root of two. The distance of two
    points is at most their shell error, and that is at most the root of two times as large.
    """

    def __init__(self, poses: Poses, radius: float) -> None:
        self.poses, self.radius = poses, radius
        axes = np.moveaxis(matrices(poses.quaternions), -1, 0).reshape(-1, 9)
        self._long = radius / np.sqrt(2.0)
        self.points = np.column_stack((poses.positions, axes * self._long))

    def errors(self, first: int, last: int, pose: Poses) -> np.ndarray:
        """Return by how much a pose () is off from those that it has from a place to another one, shape (n,)."""
        return shell_error(self.poses[first : last + 1], pose, self.radius)

    def best_pose(self, first: int, last: int) -> Poses:
        """Return the pose () with the smallest largest error there, as far as distances of points tell: nearly.

        Source: Bădoiu and Clarkson, "Smaller core-sets for balls", 2003: from the middle towards what is farthest, by
        less and less.
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
        """Return the stretches of at least so many free frames (m,) on which it is at rest, the longest first.

        None of them overlap. Each is as tight as it may be for a few frames less. None is within those from each frame
        to the last one that it may rest to anyway, in something else (m,): see `reached`.
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
        """Return the last place (m,) up to which it may be at rest from each place on, on free frames (m,).

        Two poses that are within the tolerance of a third one differ by twice as much at most, in each number of their
        points.
        """
        # A frame that is not free is farther away than anything, and so is all that is behind it.
        points = np.column_stack((self.points, 4.0 * tolerance * np.cumsum(~free)))
        count, lows, highs = len(points), [points], [points]
        while 2 ** len(lows) <= count:
            step = 2 ** (len(lows) - 1)
            lows.append(np.minimum(lows[-1][:-step], lows[-1][step:]))
            highs.append(np.maximum(highs[-1][:-step], highs[-1][step:]))
        at, low, high = np.arange(count), points.copy(), points.copy()
        for level in range(len(lows) - 1, -1, -1):
            # As many places more as two to the power of the level.
            place = np.minimum(at + 1, len(lows[level]) - 1)
            lower, higher = np.minimum(low, lows[level][place]), np.maximum(high, highs[level][place])
            fits = (at + 1 + 2**level <= count) & (higher - lower <= 2.0 * tolerance).all(axis=1)
            at = np.where(fits, at + 2**level, at)
            low, high = np.where(fits[:, None], lower, low), np.where(fits[:, None], higher, high)
        return at

    def _rest_within(self, first: int, last: int, tolerance: float, least: int) -> RestStretch | None:
        """Return a long stretch of these places on which it is at rest; None where none is long enough."""
        rest = self._longest(first, last, tolerance)
        if rest.frames < least:
            return None
        while rest.largest > 0.0:
            tighter = self._longest(rest.first, rest.last, TIGHTER_ERROR_RATIO * rest.largest)
            if tighter.frames < max(least, rest.frames - max(2, int(MAX_FRAMES_LOST_RATIO * rest.frames))):
                break
            rest = tighter
        return rest

    def _longest(self, first: int, last: int, tolerance: float) -> RestStretch:
        """Return the longest stretch of these places that is found to be at rest, which may be a single frame."""
        begin, end = first, last
        found = RestStretch(first, first, self.poses[first], 0.0)
        for _ in range(MAX_EXTENSION_ROUNDS):
            pose = self.best_pose(begin, end)
            errors = self.errors(first, last, pose)
            edges = np.flatnonzero(np.diff(np.concatenate(([False], errors <= tolerance, [False]))))
            if not len(edges):
                # Not even a frame of them: the middle may do better.
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
        """Return whether it moves by more than a distance here while it is at rest in something else."""
        pose = self.best_pose(rest.first, rest.last)
        return bool(self.errors(rest.first, rest.last, pose).max() > distance)


def relative(holder: Poses, poses: Poses) -> Poses:
    """Return where poses (m,) are in what is at others (m,)."""
    return placed(inverse(holder), poses)
