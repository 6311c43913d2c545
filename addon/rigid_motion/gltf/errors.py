"""How far off nodes are in the world, where other tracks move them: an upper bound that is looked through to the most.

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


@dataclass(frozen=True, eq=False)
class World:
    """Nodes that move, and what they are measured by."""

    nodes: Nodes
    moving: np.ndarray
    """The numbers of those that move, parents before their children, shape (n,)."""

    radii: np.ndarray
    """Of the balls, in the unit of the document, shape (n,)."""

    truth: Tracks
    times: np.ndarray
    """The moments between which all tracks run evenly, shape (m,)."""

    @cached_property
    def eighths(self) -> np.ndarray:
        """The moments, and so many parts of the gaps between them."""
        gaps = self.times[:-1, None] + np.diff(self.times)[:, None] * np.arange(PARTS) / PARTS
        return np.append(gaps.ravel(), self.times[-1])

    @cached_property
    def _back(self) -> np.ndarray:
        """From the axes of the nodes where they are largest to those of their balls, (n, 1, 3, 3)."""
        axes = self.nodes.worlds(self.moving, self.truth, self.times).axes
        largest = np.argmax(np.einsum("nmij,nmij->nm", axes, axes), axis=1)
        return np.linalg.pinv(axes[np.arange(len(axes)), largest])[:, None]

    def largest_error(self, shown: Tracks, times: np.ndarray) -> float:
        """The largest displacement of any point of any ball at times, in the unit of the document."""
        largest, step = 0.0, max(1, AT_ONCE // len(self.moving))
        for first in range(0, len(times), step):
            some = times[first : first + step]
            there, truth = (
                AffineMaps(maps.axes @ self._back, maps.origins)
                for maps in (self.nodes.worlds(self.moving, tracks, some) for tracks in (shown, self.truth))
            )
            largest = _largest_displacement(there, truth, self.radii[:, None], largest)
        return largest

    def places(self, tracks: Tracks, times: np.ndarray) -> np.ndarray:
        """Where the nodes are, shape (n, m, 3)."""
        return self.nodes.worlds(self.moving, tracks, times).origins


def _largest_displacement(maps: AffineMaps, truth: AffineMaps, radii: np.ndarray, least: float) -> float:
    """The largest displacement of any ball, or the least that is asked for."""
    bounds = displacement_bound(maps, truth, radii).ravel()
    radii = np.broadcast_to(radii, maps.origins.shape[:-1]).ravel()
    maps, truth = (AffineMaps(some.axes.reshape(-1, 3, 3), some.origins.reshape(-1, 3)) for some in (maps, truth))
    waiting = np.flatnonzero(bounds > least)
    waiting = waiting[np.argsort(-bounds[waiting])]
    for first in range(0, len(waiting), EXACTLY):
        some = waiting[first : first + EXACTLY]
        if bounds[some[0]] <= least:
            break
        least = max(least, float(ball_displacement(maps[some], truth[some], radii[some]).max()))
    return least
