"""Corrections of a recording: how far each sample is moved, so that the jerk is as large as it is around there.

Of corrections d and third derivatives s the sum of d^2 / noise^2 and h s^2 / J^2 is made least, for places and for
rotation vectors in world axes; J^2, the density of the jerk around a sample, is found by MacKay's fixed point. Where it
stands out of the noise, in places or rotations, there is a hit, and nothing is expected of the jerk of either. Source:
D. MacKay, *Bayesian interpolation*, Neural Computation 4, 1992.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from .banded import Banded
from .differences import coefficients, differences_of_positions, differences_of_rotations, turned_in_world
from .poses import Poses
from .trembling import Trembling, mean_around

JERK_ORDER = 3
"""Of the derivative that is small: jerk."""

JERK_ROUNDS = 12
"""In which the size of the jerk is found."""

JERK_REACH_SAMPLES = 1
"""Samples on either side over which it is as large: hits are as short."""

MIN_JERK_RATIO = 1e-9
"""Of the jerk that noise makes is always allowed: more would be lost in rounding."""

MIN_HIT_RATIO, HIT_POWER = 0.1, 2
"""Where the density of the jerk is more than such a part of that of the noise, it counts by this power as many times as
large: the edges of a hit, which is in one axis and shorter than what is averaged over, were cut by what is expected."""

MIN_MOTION_PER_NOISE, STIFFNESS_POWER, MAX_STIFFNESS = 1.25, 6, 100.0
"""Where a recording trembles by more than so many times its noise, that may be motion, and this power of what is above
keeps samples where they are, up to so many times."""

CAP_POWER = 2.5
"""By this power of how many times too far they are off samples are drawn back."""


@dataclass
class Channel:
    """The corrections of places, or of rotations: `differences` returns the third derivatives (n - 3, 3) with
    corrections (n, 3) made.
    """

    differences: Callable[[np.ndarray], np.ndarray]
    coefficients: np.ndarray
    steps: np.ndarray
    noise: float
    precisions: np.ndarray
    """One over the squares of the noise of samples (n,), 0 of those that are left out."""

    corrections: np.ndarray = field(init=False)
    densities: np.ndarray = field(init=False)
    of_noise: np.ndarray = field(init=False)
    """The densities that the noise alone would have."""

    def __post_init__(self) -> None:
        self.corrections = np.zeros((len(self.precisions), 3))
        self.of_noise = self.noise**2 * self.steps * np.einsum("nk,nk->n", self.coefficients, self.coefficients)
        self.densities = self._density(1.0)

    def _density(self, determined: np.ndarray | float) -> np.ndarray:
        """Return how large the jerk is around each sample, where it determines so much of what is found."""
        found = self.differences(self.corrections)
        squares = np.einsum("nc,nc->n", found, found) / 3.0
        around = mean_around(self.steps * squares, JERK_REACH_SAMPLES) / determined
        return np.maximum(around, MIN_JERK_RATIO * self.of_noise)

    @property
    def moved(self) -> float:
        """Mean square of what samples are moved by, in squares of the noise."""
        return float(np.einsum("n,nc->", self.precisions, self.corrections**2)) / (
            3.0 * np.count_nonzero(self.precisions)
        )

    def settle(self) -> None:
        """Find how large the jerk is."""
        c = self.coefficients
        for _ in range(JERK_ROUNDS):
            inverse = self.improve().inverse_diagonals()
            spread = np.zeros(len(c))
            for first in range(JERK_ORDER + 1):
                for second in range(first, JERK_ORDER + 1):
                    twice = 1.0 if first == second else 2.0
                    covariances = inverse[second - first, first : first + len(c)]
                    spread += twice * c[:, first] * c[:, second] * covariances
            determined = mean_around(np.maximum(1.0 - spread * self.steps / self.densities, 0.0), JERK_REACH_SAMPLES)
            self.densities = self._density(np.maximum(determined, 1e-9))

    def improve(self) -> Banded:
        """Make one step of Newton's towards the best corrections, and return the matrix of that."""
        weights = self.steps / self.densities
        pulled = weights[:, None] * self.differences(self.corrections)
        gradient = self.precisions[:, None] * self.corrections
        for own in range(JERK_ORDER + 1):
            gradient[own : own + len(weights)] += self.coefficients[:, own, None] * pulled
        matrix = Banded(self.precisions, self.coefficients, weights)
        self.corrections = self.corrections - matrix.solve(gradient)
        return matrix


class Corrections:
    """Those of a body, from poses (n,) at times (n,), that trembles so much; samples (n,) are left out, and follow."""

    def __init__(self, times: np.ndarray, start: Poses, noise: Trembling, out: np.ndarray) -> None:
        self._start = start
        shares = coefficients(times, JERK_ORDER)
        steps = (times[JERK_ORDER:] - times[:-JERK_ORDER]) / JERK_ORDER

        def of_places(corrections: np.ndarray) -> np.ndarray:
            return differences_of_positions(start.positions + corrections, shares)

        def of_rotations(corrections: np.ndarray) -> np.ndarray:
            return differences_of_rotations(turned_in_world(start.quaternions, corrections), shares)

        def channel(differences: Callable[[np.ndarray], np.ndarray], size: float, here: np.ndarray) -> Channel | None:
            if not size:
                return None
            stiff = np.clip(here / (MIN_MOTION_PER_NOISE * size), 1.0, MAX_STIFFNESS) ** STIFFNESS_POWER
            return Channel(differences, shares, steps, size, np.where(out, 0.0, stiff / size**2))

        self.places = channel(of_places, noise.position, noise.here[0])
        self.turns = channel(of_rotations, noise.rotation, noise.here[1])
        for each in self._all:
            each.settle()
        self.moved = np.array([each.moved if each else 0.0 for each in (self.places, self.turns)])
        """Mean squares of what samples are moved by, in those of the noise, of places and of rotations."""
        hits = [each.densities / (MIN_HIT_RATIO * each.of_noise) for each in self._all]
        for each in self._all:
            each.densities = each.densities * np.maximum(1.0, np.max(hits, axis=0)) ** HIT_POWER
            each.improve()

    @property
    def _all(self) -> list[Channel]:
        return [each for each in (self.places, self.turns) if each]

    def copied(self) -> Corrections:
        """Return the same, to be drawn back."""
        result = copy(self)
        result.places, result.turns = copy(self.places), copy(self.turns)
        return result

    def draw_back(self, over: np.ndarray) -> None:
        """Draw samples back that are too far off by so many times (n,), as the motion around them allows."""
        for each in self._all:
            each.precisions = each.precisions * np.maximum(over, 1.0) ** CAP_POWER
            each.improve()

    def made(self, share: np.ndarray) -> Poses:
        """Return poses with these shares (n,) of the corrections made."""
        poses = self._start
        if self.places:
            poses = replace(poses, positions=poses.positions + share[:, None] * self.places.corrections)
        if self.turns:
            turned = turned_in_world(poses.quaternions, share[:, None] * self.turns.corrections)
            poses = replace(poses, quaternions=turned)
        return poses
