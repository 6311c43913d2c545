"""Joints that stand on the ground: how far they slide there, and when too far."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from ..motion.contacts import LOW, SLOW, contacts, spans
from .errors import NOWHERE, World
from .tracks import Tracks

UPWARDS = 1
"""The axis of glTF that is."""


class Feet:
    """The joints of a world that stand on the ground for a while.

    Parameters
    ----------
    world : World
    joints : iterable of int
        Nodes that may stand.
    """

    def __init__(self, world: World, joints: Iterable[int]) -> None:
        self.world = world
        self.rows = np.flatnonzero(np.isin(world.moving, list(joints)))

    @cached_property
    def stand(self) -> np.ndarray:
        """Which joints stand, and when, shape (rows, m)."""
        world, times, shape = self.world, self.world.times, (len(self.rows), len(self.world.times))
        if not len(self.rows) or len(times) < 2:
            return np.zeros(shape, dtype=bool)
        heights, lowest = np.empty(len(times)), np.inf
        for block in world.seen(world.truth):
            upwards = block.maps[0].origins[self.rows, :, UPWARDS]
            heights[block.samples], lowest = np.ptp(upwards, axis=0), min(lowest, float(upwards.min()))
        height, low, slow = float(np.median(heights)), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        before = None
        for block in world.seen(world.truth):
            positions = block.maps[0].origins[self.rows]
            low[:, block.samples] = positions[..., UPWARDS] - lowest <= LOW * height
            before = positions[:, :1] if before is None else before
            ways = np.linalg.norm(np.diff(np.concatenate((before, positions), axis=1), axis=1), axis=-1)
            slow[:, block.samples] = ways <= SLOW * height * np.diff(times, prepend=times[0])[block.samples]
            before = positions[:, -1:]
        return contacts(times, low, slow[:, 1:])

    @cached_property
    def spans(self) -> np.ndarray:
        """The row of a joint, and the first and the last sample of a time in which it stands, shape (s, 3)."""
        result = np.array(spans(self.stand), dtype=np.int64).reshape(-1, 3)
        result[:, 0] = self.rows[result[:, 0]]
        return result

    @cached_property
    def _before(self) -> list[np.ndarray]:
        return self._ways(self.world.truth)

    def slides(self, tracks: Tracks) -> tuple[float, float]:
        """Return the farthest that any of them gets from where it stood at first, before and after."""
        before, after = (max(map(np.max, ways), default=0.0) for ways in (self._before, self._ways(tracks)))
        return float(before), float(after)

    def farther(self, tracks: Tracks) -> float:
        """How much farther than before any of them slides, at most."""
        ways = zip(self._before, self._ways(tracks), strict=True)
        return max((float(after.max() - before.max()) for before, after in ways), default=0.0)

    def slips(self, tracks: Tracks, more: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows of joints and samples at which one slides by more than this farther than before, and began to."""
        rows, samples = [NOWHERE], [NOWHERE]
        for (row, first, _), before, after in zip(self.spans, self._before, self._ways(tracks), strict=True):
            padded = np.pad(after, 1)
            peaks = (after > before.max() + more) & (after >= padded[:-2]) & (after >= padded[2:])
            if peaks.any():
                samples.append(first + np.append(0, np.flatnonzero(peaks)))
                rows.append(np.full(len(samples[-1]), row))
        return np.concatenate(rows), np.concatenate(samples)

    def _ways(self, tracks: Tracks) -> list[np.ndarray]:
        """How far each gets from where it stood at first, an array for each span."""
        if not len(self.spans):
            return []
        rows, firsts, lasts = self.spans.T
        result, starts = [np.empty(length) for length in lasts - firsts + 1], np.empty((len(rows), 3))
        for block in self.world.seen(tracks):
            origins, samples = block.maps[0].origins, block.samples
            for number in np.flatnonzero((firsts < samples.stop) & (lasts >= samples.start)).tolist():
                begin, end = max(firsts[number], samples.start), min(lasts[number] + 1, samples.stop)
                positions = origins[rows[number], begin - samples.start : end - samples.start]
                if begin == firsts[number]:
                    starts[number] = positions[0]
                ways = np.linalg.norm(positions - starts[number], axis=1)
                result[number][begin - firsts[number] : end - firsts[number]] = ways
        return result
