"""Breakdowns: keys that lie on the path of a mode between the neighbouring keys, instead of shaping the path.

One more key on the path of a smooth mode or of a blend of motors changes that path. So a key inserted on an in-between
would change the motion around it. A key of type *Breakdown* leaves the path unchanged, and only sets when the body is
there. When moved off the path, it takes the path along, smoothly if the mode is smooth.

Paths have P segments, which breakdowns divide into S segments from key to key. The progress of a key along its path is
where the path is nearest to the key, with a radian counting as one unit of length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...motion import Poses, twists
from ...motion.quaternions import multiply, rotate
from .bodies import between

COARSE_PROGRESS = np.linspace(-0.25, 1.25, 49)
"""Progress at which a path is first compared with a key: easing may overshoot both ends."""

FINE_OFFSETS = np.linspace(-1.0, 1.0, 9)
"""Offsets from the best progress so far that each refinement tries, in steps that shrink to a quarter each round."""

REFINEMENT_ROUNDS = 14
"""The number of refinements: enough for more digits than single precision has."""

PosesAt = Callable[[np.ndarray, np.ndarray], Poses]
"""From the number of samples on each path segment (P,) and their progress (m,) to the poses (m,)."""


@dataclass(frozen=True, eq=False)
class Passages:
    """How S segments from key to key lie on the P segments of paths."""

    first: np.ndarray
    """The index of the first segment on each segment of a path, and the total at the end, shape (P + 1,)."""

    progress: np.ndarray
    """The progress along the path segment at the start and the end of each segment, shape (2, S)."""

    offsets: Poses
    """The offset from the path at the start of each segment, in the body's own axes, shape (S,)."""

    changes: np.ndarray
    """The twist that changes the offset up to the end of each segment, and the growth of log scale, shape (7, S)."""

    smooth: np.ndarray
    """True if the offset changes without a corner, shape (S,)."""

    @classmethod
    def of(cls, passed: np.ndarray, keys: Poses, poses_at: PosesAt, smooth: np.ndarray) -> Passages:
        """Find the progress of keys (S, 2), at both ends of segments, on their paths.

        `passed` (S,) says which segments start with a key that lies on a path, `smooth` (P,) which paths are smooth.
        """
        first = np.append(np.flatnonzero(~passed), len(passed))
        owners = np.repeat(np.arange(len(first) - 1), np.diff(first))
        inner = np.flatnonzero(passed)
        progress, offs = np.zeros((2, len(passed))), np.zeros((2, 7, len(passed)))
        progress[1] = 1.0
        many = np.bincount(owners[inner], minlength=len(first) - 1)
        at, off = _nearest(keys[inner, 0], many, poses_at)
        progress[0, inner] = progress[1, inner - 1] = at
        offs[0][:, inner] = offs[1][:, inner - 1] = off
        offsets, ends = (_poses_of_twists(offset) for offset in offs)
        changes = np.concatenate((between(offsets, ends)[:6], offs[1, 6:] - offs[0, 6:]))
        return cls(first, progress, offsets, changes, smooth[owners])

    def along(self, counts: np.ndarray, progress: np.ndarray) -> tuple[np.ndarray, Poses]:
        """Return progress along paths and offsets from them, (m,) each, for samples at `progress`, `counts` of each."""
        begin, end = self.progress.repeat(counts, axis=1)
        share = np.clip(progress, 0.0, 1.0)
        share = np.where(self.smooth.repeat(counts), share * share * (3.0 - 2.0 * share), share)
        offsets = self.offsets[np.arange(len(self.smooth)).repeat(counts)]
        return begin + (end - begin) * progress, moved_by(
            offsets, _poses_of_twists(share * self.changes.repeat(counts, axis=1))
        )


def moved_by(poses: Poses, moves: Poses) -> Poses:
    """Return poses (m,) moved by motions (m,) in the body's own axes."""
    return replace(
        poses,
        positions=poses.positions + rotate(poses.quaternions, moves.positions),
        quaternions=multiply(poses.quaternions, moves.quaternions),
        scales=None if poses.scales is None else poses.scales * moves.scales,
    )


def _nearest(keys: Poses, counts: np.ndarray, poses_at: PosesAt) -> tuple[np.ndarray, np.ndarray]:
    """Return the progress at which paths are nearest to keys (k,), and the twists and log scale (7, k) from there.

    `counts` are the numbers of keys on each path.
    """
    many = np.repeat(np.arange(len(counts)), counts)

    def off(progress: np.ndarray) -> np.ndarray:
        each = progress.shape[1]
        flat = np.arange(len(many)).repeat(each)
        return between(poses_at(counts * each, progress.ravel()), keys[flat]).reshape(7, -1, each)

    def nearest(tried: np.ndarray) -> np.ndarray:
        misses = off(tried)
        return np.take_along_axis(tried, np.einsum("rke,rke->ke", misses, misses).argmin(axis=1)[:, None], axis=1)

    best, step = nearest(np.tile(COARSE_PROGRESS, (len(many), 1))), COARSE_PROGRESS[1] - COARSE_PROGRESS[0]
    low, high = best - step, best + step
    for number in range(REFINEMENT_ROUNDS):
        best = nearest(np.clip(best + 0.25**number * step * FINE_OFFSETS, low, high))
    return best[:, 0], off(best)[..., 0]


def _poses_of_twists(rows: np.ndarray) -> Poses:
    """Return the motions (n,) for twists and growths of log scale (7, n)."""
    quaternions, translations = twists.exponential(rows[:6])
    return Poses(translations.T, quaternions.T, np.exp(rows[6]))
