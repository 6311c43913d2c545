"""Breakdowns: keys that lie on the path of a mode between the keys around them, instead of shaping it.

The path of a smooth mode or of a blend of motors is another one where a key more lies on it. A key that is inserted on
an in-between would so change the motion around it. Of type *Breakdown* it leaves the path as it is, and tells only when
the body is there; moved off the path it takes the path along, smoothly where the mode is.

A path has P segments, of S from key to key. How far a key has come along its path is where that is nearest to it, a
radian counting as much as a unit of length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...motion import Poses, twists
from ...motion.quaternions import multiply, rotate
from .bodies import between

COARSE_PROGRESS = np.linspace(-0.25, 1.25, 49)
"""Progress at which a path is first compared with a key: an easing may pass both ends."""

FINE_OFFSETS = np.linspace(-1.0, 1.0, 9)
"""Around the best of these it is compared on nine more, in the distance of two of them, over and over."""

REFINEMENT_ROUNDS = 14
"""How often: to more digits than single precision has."""

PosesAt = Callable[[np.ndarray, np.ndarray], Poses]
"""From counts (P,) and progress (m,) to the poses (m,) on paths."""


@dataclass(frozen=True, eq=False)
class Passages:
    """How S segments from key to key lie on the P segments of paths."""

    first: np.ndarray
    """The first of the segments on each segment of a path, and the end, shape (P + 1,)."""

    progress: np.ndarray
    """The progress along its segment of the path where each of the segments starts and ends, shape (2, S)."""

    offsets: Poses
    """The difference from the path where each of the segments starts, in the body's own axes, shape (S,)."""

    changes: np.ndarray
    """The twists by which that changes up to its end, and the growth of log scale, shape (7, S)."""

    smooth: np.ndarray
    """True if it changes without a corner, shape (S,)."""

    @classmethod
    def of(cls, passed: np.ndarray, keys: Poses, poses_at: PosesAt, smooth: np.ndarray) -> Passages:
        """Find where keys (S, 2) at both ends of segments are on their paths.

        `passed` (S,) says which of the segments start with a key that lies on a path, `smooth` (P,) is that of paths.
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
        offsets, ends = (_moved(offset) for offset in offs)
        changes = np.concatenate((between(offsets, ends)[:6], offs[1, 6:] - offs[0, 6:]))
        return cls(first, progress, offsets, changes, smooth[owners])

    def along(self, counts: np.ndarray, progress: np.ndarray) -> tuple[np.ndarray, Poses]:
        """Return progress (m,) along paths, and how far off it the body is, from that in segments with counts (S,)."""
        begin, end = self.progress.repeat(counts, axis=1)
        share = np.clip(progress, 0.0, 1.0)
        share = np.where(self.smooth.repeat(counts), share * share * (3.0 - 2.0 * share), share)
        offsets = self.offsets[np.arange(len(self.smooth)).repeat(counts)]
        return begin + (end - begin) * progress, moved_by(offsets, _moved(share * self.changes.repeat(counts, axis=1)))


def moved_by(poses: Poses, moves: Poses) -> Poses:
    """Return poses (m,) after moves (m,) along the body's own axes."""
    return replace(
        poses,
        positions=poses.positions + rotate(poses.quaternions, moves.positions),
        quaternions=multiply(poses.quaternions, moves.quaternions),
        scales=None if poses.scales is None else poses.scales * moves.scales,
    )


def _nearest(keys: Poses, counts: np.ndarray, poses_at: PosesAt) -> tuple[np.ndarray, np.ndarray]:
    """Return where paths are nearest to keys (k,), and the twists and log scale (7, k) from there to the keys.

    `counts` are those of the keys on each path.
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


def _moved(rows: np.ndarray) -> Poses:
    """Return the motions (n,) of twists and growths of log scale (7, n)."""
    quaternions, translations = twists.exponential(rows[:6])
    return Poses(translations.T, quaternions.T, np.exp(rows[6]))
