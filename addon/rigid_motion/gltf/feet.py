"""Joints that stand on the ground: how far they slide there, and when too far."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from ..motion.contacts import spans, standing
from .errors import World
from .nodes import Tracks


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
        self.places = np.flatnonzero(np.isin(world.moving, list(joints)))

    @cached_property
    def spans(self) -> list[tuple[int, int, int]]:
        """The place of a joint, and the first and the last sample of a time in which it stands."""
        if not len(self.places) or len(self.world.times) < 2:
            return []
        x, y, z = np.moveaxis(self.world.positions[self.places], -1, 0)
        stands = standing(self.world.times, np.stack((x, -z, y), axis=-1))  # glTF has the second axis upwards.
        return [(int(self.places[joint]), first, last) for joint, first, last in spans(stands)]

    def slides(self, tracks: Tracks) -> tuple[float, float]:
        """The farthest that any of them gets from where it stood at first, before and after."""
        before, after = (max(map(max, all_ways), default=0.0) for all_ways in self._ways(tracks))
        return float(before), float(after)

    def slips(self, tracks: Tracks, more: float) -> tuple[np.ndarray, np.ndarray]:
        """Places of joints and samples at which one slides by more than this farther than before, and began to."""
        places, samples = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for (place, first, _), before, after in zip(self.spans, *self._ways(tracks), strict=True):
            padded = np.pad(after, 1)
            peaks = (after > before.max() + more) & (after >= padded[:-2]) & (after >= padded[2:])
            if peaks.any():
                samples.append(first + np.append(0, np.flatnonzero(peaks)))
                places.append(np.full(len(samples[-1]), place))
        return np.concatenate(places), np.concatenate(samples)

    def _ways(self, tracks: Tracks) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """How far each gets from where it stood at first, a row for each span, before and after."""
        if not self.spans:
            return [], []
        shown = dict(zip(self.places.tolist(), self.world.positions_of(tracks, self.places), strict=True))
        before, after = (
            [
                np.linalg.norm(positions[place][first : last + 1] - positions[place][first], axis=1)
                for place, first, last in self.spans
            ]
            for positions in (self.world.positions, shown)
        )
        return before, after
