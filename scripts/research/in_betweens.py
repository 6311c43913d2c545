"""Test cases of in-betweens for benchmarks: keys, and the times to evaluate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.poses import reshaped


@dataclass(frozen=True, eq=False)
class Case:
    """Objects (b) with keys (n), evaluated m times each; also as a list of pairs, which other libraries need."""

    title: str
    key_times: np.ndarray
    keys: Poses
    times: np.ndarray

    @property
    def in_betweens(self) -> int:
        return self.keys.shape[0] * self.times.shape[-1]

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the index of each in-between's first key, among all keys of all objects, and the fraction u."""
        objects, n = self.keys.shape
        times = np.broadcast_to(self.times, (objects, self.times.shape[-1]))
        segment = np.clip(np.searchsorted(self.key_times, times, side="right") - 1, 0, n - 2)
        u = (times - self.key_times[segment]) / (self.key_times[segment + 1] - self.key_times[segment])
        return (segment + n * np.arange(objects)[:, None]).ravel(), u.ravel()

    def ends(self) -> tuple[Poses, Poses, np.ndarray]:
        """Return both keys of each in-between, and u."""
        first, u = self.pairs()
        keys = reshaped(self.keys, -1)
        return keys[first], keys[first + 1], u

    def filled_in(self, mode: str) -> Poses:
        """Return the in-betweens of a mode, shape (b, m); each segment is computed once."""
        return interpolate(self.key_times, self.keys, self.times, mode)

    def in_the_algebra(self, mode: str) -> Poses:
        """Return the same, shape (b m,), by the algebra that the mode is named after; each starting from its keys."""
        return MODES[mode].reference(*self.ends())
