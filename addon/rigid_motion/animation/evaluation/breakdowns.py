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

GRID = np.linspace(-0.25, 1.25, 49)
"""Progress at which a path is first compared with a key: an easing may pass both ends."""

STEPS = 14
"""Steps of the search from there, for more digits than single precision has."""

DIFFERENCE = 1e-4
"""The progress on either side that slopes are measured over."""

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
    def of(
        cls, passed: np.ndarray, keys: Poses, poses_at: PosesAt, smooth: np.ndarray, counting: np.ndarray
    ) -> Passages:
        """Find where keys are on their paths.

        Parameters
        ----------
        passed : array of bool, shape (S,)
            Which of the segments from key to key start with a key that lies on a path.
        keys : Poses, shape (S, 2)
            At both ends of each.
        poses_at : PosesAt
        smooth : array of bool, shape (P,)
        counting : array of bool, shape (7, S)
            What of the twist and the growth to a key says how far that is.
        """
        first = np.append(np.flatnonzero(~passed), len(passed))
        owners = np.repeat(np.arange(len(first) - 1), np.diff(first))
        inner = np.flatnonzero(passed)
        progress, offs = np.zeros((2, len(passed))), np.zeros((2, 7, len(passed)))
        progress[1] = 1.0
        many = np.bincount(owners[inner], minlength=len(first) - 1)
        at, off = _nearest(keys[inner, 0], many, poses_at, counting[:, inner])
        progress[0, inner] = progress[1, inner - 1] = at
        offs[0][:, inner] = offs[1][:, inner - 1] = off
        offsets, ends = (_moved(offset) for offset in offs)
        changes = np.concatenate((_between(offsets, ends)[:6], offs[1, 6:] - offs[0, 6:]))
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


def _nearest(keys: Poses, counts: np.ndarray, poses_at: PosesAt, counting: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where paths are nearest to keys (k,), and the twists and log scale (7, k) from there to the keys.

    `counts` are those of the keys on each path.
    """
    many = np.repeat(np.arange(len(counts)), counts)

    def off(progress: np.ndarray) -> np.ndarray:
        each = progress.shape[1]
        flat = np.arange(len(many)).repeat(each)
        return _between(poses_at(counts * each, progress.ravel()), keys[flat]).reshape(7, -1, each)

    everywhere = np.where(counting[..., None], off(np.broadcast_to(GRID, (len(many), len(GRID)))), 0.0)
    squared = np.einsum("rke,rke->ke", everywhere, everywhere)

    def slopes(progress: np.ndarray) -> np.ndarray:
        three = np.where(counting[..., None], off(progress[:, None] + (-DIFFERENCE, 0.0, DIFFERENCE)), 0.0)
        before, here, behind = np.moveaxis(three, 2, 0)
        return np.einsum("rk,rk->k", behind - before, here)

    # Where the distance has no slope, by the Illinois method.
    nearest = GRID[np.argmin(squared, axis=1)]
    low, high = nearest - (GRID[1] - GRID[0]), nearest + (GRID[1] - GRID[0])
    at_low, at_high = slopes(low), slopes(high)
    result = np.where(at_low > 0.0, low, high)
    crosses = (at_low < 0.0) & (at_high > 0.0)
    for _ in range(STEPS):
        span = np.where(at_high > at_low, at_high - at_low, 1.0)
        result = np.where(crosses, (low * at_high - high * at_low) / span, result)
        here = slopes(result)
        falls = here < 0.0
        low, high = np.where(falls, result, low), np.where(falls, high, result)
        at_low, at_high = np.where(falls, here, 0.5 * at_low), np.where(falls, 0.5 * at_high, here)
    return result, off(result[:, None])[..., 0]


def _between(first: Poses, second: Poses) -> np.ndarray:
    """Return the twists from poses (n,) to others, and the growth of log scale, shape (7, n)."""
    rows = np.zeros((7, len(first.positions)))
    rows[:6] = twists.between(first.positions, first.quaternions, second.positions, second.quaternions)
    if first.scales is not None:
        rows[6] = np.log(second.scales / first.scales)
    return rows


def _moved(rows: np.ndarray) -> Poses:
    """Return the motions (n,) of twists and growths of log scale (7, n)."""
    quaternions, translations = twists.exponential(rows[:6])
    return Poses(translations.T, quaternions.T, np.exp(rows[6]))
