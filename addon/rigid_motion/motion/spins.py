"""Spins: additional whole turns of a body between two keys, which stay unchanged.

A spin turns about an axis through the body's origin, fixed in the body or in space, in proportion to the progress of
the segment. A segment M(u) becomes M(u) exp(2 pi k u e) or, for an axis fixed in space, has exp(2 pi k u e) on the
other side of its rotation. At both keys, this leaves the rotation as it is. The path of the origin does not change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .poses import Poses
from .quaternions import conjugate, multiply, rotate

FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Spins:
    """The spins of S segments."""

    turns: np.ndarray
    """The number of turns, shape (S,); the sign gives the direction about the axis. Whole turns end as they begin."""

    axes: np.ndarray
    """Unit vectors, shape (3, S)."""

    in_space: np.ndarray
    """Whether an axis is fixed in space instead of in the body, shape (S,)."""

    def twists(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the angular velocities (3, 2, S) that spins add at both keys in unit time, along the body's axes.

        The arguments are the unit quaternions (S, 4) of the first and second keys.
        """
        turn = (FULL_TURN * self.turns * self.axes).T
        ends = [np.where(self.in_space[:, None], rotate(conjugate(key), turn), turn).T for key in (first, second)]
        return np.stack(ends, axis=1)

    def add_to(self, poses: Poses, counts: np.ndarray, progress: np.ndarray, some: slice = slice(None)) -> Poses:
        """Return poses (m,) in `some` segments, counts[i] of them in the i-th, spun in proportion to progress (m,)."""
        turns = self.turns[some]
        if not turns.any():
            return poses
        half = np.pi * turns.repeat(counts) * progress
        added = np.empty((len(half), 4))
        added[:, 0] = np.cos(half)
        added[:, 1:] = (np.sin(half) * self.axes[:, some].repeat(counts, axis=1)).T
        in_space = self.in_space[some].repeat(counts)[:, None]
        before, after = (np.where(in_space, *pair) for pair in ((added, poses.quaternions), (poses.quaternions, added)))
        return Poses(poses.positions, multiply(before, after), poses.scales)
