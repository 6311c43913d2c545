"""How far off nodes are in the world, where other tracks move them: proven between keys, too.

What counts is a ball around each node: no point of it is off by more. Its radius is that in the world, where the node
is largest; a node that shrinks takes its ball along.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..motion.affine import AffineMaps, ball_displacement, displacement_bound
from .nodes import Nodes, Tracks

PARTS = 8
"""Of every gap between keys: that is how closely it is looked at."""

AT_ONCE = 2**15
"""Poses that are looked at in one go."""

EXACTLY = 64
"""Poses whose displacement is worked out at once, those with the largest bounds first."""


NOWHERE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class World:
    """Nodes that move, and what they are measured by. Lengths are in the unit of the document."""

    nodes: Nodes
    moving: np.ndarray
    """The numbers of those that move, parents before their children, shape (n,)."""

    radii: np.ndarray
    """Of the balls, shape (n,)."""

    truth: Tracks
    times: np.ndarray
    """The moments between which all tracks run evenly, shape (m,)."""

    @cached_property
    def places(self) -> dict[int, int]:
        """Where each node is among those that move."""
        return {node: place for place, node in enumerate(self.moving.tolist())}

    @cached_property
    def parents(self) -> np.ndarray:
        """The place of each node's parent, -1 where that does not move, shape (n,)."""
        return np.array([self.places.get(parent, -1) for parent in self.nodes.parents[self.moving].tolist()])

    @cached_property
    def _maps(self) -> AffineMaps:
        return self._worlds(self.truth, self.times)

    @cached_property
    def positions(self) -> np.ndarray:
        """Where the nodes are at the moments, shape (n, m, 3)."""
        return self._maps.origins

    @cached_property
    def lengths_above(self) -> np.ndarray:
        """How long the axes of each node's parent are in the world, shape (n, m, 3)."""
        lengths = np.linalg.norm(self._maps.axes, axis=-2)
        found = lengths[self.parents]
        for place in np.flatnonzero(self.parents < 0).tolist():
            parent = self.nodes.parents[self.moving[place]]
            found[place] = np.linalg.norm(self.nodes.resting.axes[parent], axis=-2) if parent >= 0 else 1.0
        return found

    @cached_property
    def reaches(self) -> np.ndarray:
        """How far what hangs on each node is from it at most, with the balls around it, shape (n,); an upper bound."""
        found = self.radii.copy()
        for place in range(len(found) - 1, -1, -1):
            if (parent := self.parents[place]) >= 0:
                away = np.linalg.norm(self.positions[place] - self.positions[parent], axis=-1).max()
                found[parent] = max(found[parent], away + found[place])
        return found

    @cached_property
    def eighths(self) -> np.ndarray:
        """The moments, and so many parts of the gaps between them."""
        gaps = self.times[:-1, None] + np.diff(self.times)[:, None] * np.arange(PARTS) / PARTS
        return np.append(gaps.ravel(), self.times[-1])

    def positions_of(self, shown: Tracks, places: np.ndarray) -> np.ndarray:
        """Where some nodes are at the moments as these tracks move them, shape (places, m, 3)."""
        return self._worlds(shown, self.times).origins[places]

    def largest_error(self, shown: Tracks, times: np.ndarray) -> float:
        """The largest displacement of any point of any ball at times (t,)."""
        return self.worst(shown, times, np.inf)[0]

    def worst(self, shown: Tracks, times: np.ndarray, tolerance: float) -> tuple[float, np.ndarray, np.ndarray]:
        """Errors at times (t,): the largest, and where they are over a tolerance and not larger next to it.

        Returns
        -------
        largest : float
        places, numbers : array, shape (k,)
            Of nodes, and of the times.
        """
        largest, places, numbers = 0.0, [NOWHERE], [NOWHERE]
        step = max(1, AT_ONCE // max(1, len(self.moving)))
        for first in range(0, len(times), step):
            part = slice(first, first + step)
            truth = self._maps[:, part] if times is self.times else self._worlds(self.truth, times[part])
            maps = (self._worlds(shown, times[part]), truth)
            there, truth = (AffineMaps(some.axes @ self._to_balls, some.origins) for some in maps)
            bounds = displacement_bound(there, truth, self.radii[:, None])
            errors = np.zeros(bounds.shape)
            waiting = np.flatnonzero(bounds > min(largest, tolerance))
            waiting = waiting[np.argsort(-bounds.flat[waiting])]
            for begin in range(0, len(waiting), EXACTLY):
                some = waiting[begin : begin + EXACTLY]
                if bounds.flat[some[0]] <= min(largest, tolerance):
                    break
                errors.flat[some] = self._displacements(there, truth, some)
                largest = max(largest, float(errors.flat[some].max()))
            padded = np.pad(errors, ((0, 0), (1, 1)))
            peaks = (errors > tolerance) & (errors >= padded[:, :-2]) & (errors >= padded[:, 2:])
            place, number = np.nonzero(peaks)
            places.append(place)
            numbers.append(number + first)
        return largest, np.concatenate(places), np.concatenate(numbers)

    def _worlds(self, tracks: Tracks, times: np.ndarray) -> AffineMaps:
        return self.nodes.worlds(self.moving, tracks, times)

    def _displacements(self, there: AffineMaps, truth: AffineMaps, some: np.ndarray) -> np.ndarray:
        """Those of some of the balls, by their numbers, in the shape of these."""
        where = np.unravel_index(some, there.origins.shape[:-1])
        return ball_displacement(there[where], truth[where], self.radii[where[0]])

    @cached_property
    def _to_balls(self) -> np.ndarray:
        """From axes of nodes to those of their balls, which are even where the node is largest, (n, 1, 3, 3)."""
        axes = self._maps.axes
        largest = np.argmax(np.einsum("nmij,nmij->nm", axes, axes), axis=1)
        return np.linalg.pinv(axes[np.arange(len(axes)), largest])[:, None]
