"""Corrections of a shaky recording: how far to move each sample, so that the jerk fits that of the motion around it.

The corrections d and third derivatives s minimise the sum of d^2 / noise^2 and h s^2 / J^2, for positions and for
rotation vectors in world axes. J^2, the density of the jerk around a sample, is found by MacKay's fixed point. Where it
stands out of the noise, in positions or rotations, there is a hit, and the jerk of both is left free.

Source: D. MacKay, *Bayesian interpolation*, Neural Computation 4, 1992.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from .banded import Banded
from .differences import coefficients, differences_of_positions, differences_of_rotations, turned_in_world
from .jitter import Jitter, mean_around
from .poses import Poses

JERK_ORDER = 3
"""Order of the derivative that is kept small: jerk."""

JERK_ROUNDS = 12
"""Iterations to find the size of the jerk."""

JERK_REACH_SAMPLES = 1
"""Samples on either side over which the jerk counts as equally large: hits are this short."""

MIN_JERK_RATIO = 1e-9
"""Smallest density of the jerk, as a fraction of the noise's: less would be lost in rounding."""

MIN_HIT_RATIO, HIT_POWER = 0.1, 2
"""Where the density of the jerk exceeds this fraction of the noise's, it is multiplied by this power of the ratio by
which it does: the edges of a hit, which is in one axis and shorter than the average, were cut by the expected jerk."""

MIN_MOTION_PER_NOISE, STIFFNESS_POWER, MAX_STIFFNESS = 1.25, 6, 100.0
"""Where the jitter is more than this many times the noise, it may be motion. The excess ratio, up to the third number,
to this power is the stiffness that keeps samples in place."""

CAP_POWER = 2.5
"""The precision of a sample that is too far off is multiplied by this power of the ratio, which draws it back."""


@dataclass
class Channel:
    """Corrections of positions or rotations; `differences` turns corrections (n, 3) into third derivatives (n
    - 3, 3).
    """

    differences: Callable[[np.ndarray], np.ndarray]
    coefficients: np.ndarray
    steps: np.ndarray
    noise: float
    precisions: np.ndarray
    """One over the squared noise of each sample (n,), 0 for samples that are left out."""

    corrections: np.ndarray = field(init=False)
    densities: np.ndarray = field(init=False)
    of_noise: np.ndarray = field(init=False)
    """The densities that noise alone would have."""

    def __post_init__(self) -> None:
        self.corrections = np.zeros((len(self.precisions), 3))
        self.of_noise = self.noise**2 * self.steps * np.einsum("nk,nk->n", self.coefficients, self.coefficients)
        self.densities = self._density(1.0)

    def _density(self, determined: np.ndarray | float) -> np.ndarray:
        """Return the density of the jerk around each sample, given the fraction of it that the data determine."""
        found = self.differences(self.corrections)
        squares = np.einsum("nc,nc->n", found, found) / 3.0
        around = mean_around(self.steps * squares, JERK_REACH_SAMPLES) / determined
        return np.maximum(around, MIN_JERK_RATIO * self.of_noise)

    @property
    def moved(self) -> float:
        """Mean square of the corrections, in squares of the noise."""
        return float(np.einsum("n,nc->", self.precisions, self.corrections**2)) / (
            3.0 * np.count_nonzero(self.precisions)
        )

    def settle(self) -> None:
        """Find the size of the jerk."""
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
        """Take one Newton step towards the best corrections, and return its matrix."""
        weights = self.steps / self.densities
        pulled = weights[:, None] * self.differences(self.corrections)
        gradient = self.precisions[:, None] * self.corrections
        for own in range(JERK_ORDER + 1):
            gradient[own : own + len(weights)] += self.coefficients[:, own, None] * pulled
        matrix = Banded(self.precisions, self.coefficients, weights)
        self.corrections = self.corrections - matrix.solve(gradient)
        return matrix


class Corrections:
    """Corrections of poses (n,) at times (n,) for this noise; samples `out` (n,) are ignored, and follow the others."""

    def __init__(self, times: np.ndarray, start: Poses, noise: Jitter, out: np.ndarray) -> None:
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
        for each in self._channels:
            each.settle()
        self.moved = np.array([each.moved if each else 0.0 for each in (self.places, self.turns)])
        """Mean squares of the corrections, in squares of the noise, of positions and of rotations."""
        hits = [each.densities / (MIN_HIT_RATIO * each.of_noise) for each in self._channels]
        for each in self._channels:
            each.densities = each.densities * np.maximum(1.0, np.max(hits, axis=0)) ** HIT_POWER
            each.improve()

    @property
    def _channels(self) -> list[Channel]:
        return [each for each in (self.places, self.turns) if each]

    def copied(self) -> Corrections:
        """Return a copy that can be drawn back."""
        result = copy(self)
        result.places, result.turns = copy(self.places), copy(self.turns)
        return result

    def draw_back(self, over: np.ndarray) -> None:
        """Draw back samples that are too far off by these ratios (n,), as the motion around them allows."""
        for each in self._channels:
            each.precisions = each.precisions * np.maximum(over, 1.0) ** CAP_POWER
            each.improve()

    def made(self, share: np.ndarray) -> Poses:
        """Return the poses with these fractions (n,) of the corrections applied."""
        poses = self._start
        if self.places:
            poses = replace(poses, positions=poses.positions + share[:, None] * self.places.corrections)
        if self.turns:
            turned = turned_in_world(poses.quaternions, share[:, None] * self.turns.corrections)
            poses = replace(poses, quaternions=turned)
        return poses
