"""How much a recording trembles: the part of it that no motion explains.

White noise is as large in differences of any order, once they are divided by what they do to it; motion is the smaller
the higher the order, where samples come often enough. So the noise is the least that is found in several orders and
shares of the samples, and, as the least of several that are right would be too little, the mean of all that agree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .differences import coefficients, differences
from .poses import Poses

DIFFERENCE_ORDERS = range(3, 9)
"""Of the differences that are tried."""

QUIET_RATIOS, QUIET_NORMS = (0.25, 0.5, 0.75), (1.10123, 1.53817, 2.02691)
"""These shares of the differences are the quietest, and the norms below which as many of normal vectors (3,) are. They
leave hits and fast stretches out."""

AGREEING_RATIO = 2.2
"""Over the root of the number of samples: by this part what is found in one way may be more than the least, and agrees.
Twice the standard deviation that it has in white noise."""

FILTERED_NOISE_RATIO = 0.8
"""Where the highest order has less than this part of what a middle one has, the noise has been filtered out already."""

MIDDLE_ORDER = 5

NOISE_REACH_SAMPLES = 8
"""Samples on either side that say how much a recording trembles here."""


class Trembling(NamedTuple):
    """Noise of places, metres, and of rotations, radians: standard deviations along an axis, 0 where none is found.

    `here` has the same for each sample, shape (2, n): more than the former where motion cannot be told from noise.
    """

    position: float
    rotation: float
    here: np.ndarray


def trembling(times: np.ndarray, poses: Poses) -> Trembling:
    """Return how much a recording trembles, of times (n,) in seconds and poses (n,) with unit quaternions.

    It needs `ORDERS[-1] + 2` samples; with fewer nothing is found.
    """
    count = len(times)
    here = np.full((2, count), np.inf)
    if count <= DIFFERENCE_ORDERS[-1] + 1:
        return Trembling(0.0, 0.0, np.zeros((2, count)))
    found = np.empty((len(DIFFERENCE_ORDERS), len(QUIET_RATIOS), 2))
    for row, order in enumerate(DIFFERENCE_ORDERS):
        scaled = coefficients(times, order)
        scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
        for channel, each in enumerate(differences(poses, scaled)):
            squares = np.einsum("nc,nc->n", each, each)
            found[row, :, channel] = np.sqrt(np.quantile(squares, QUIET_RATIOS)) / QUIET_NORMS
            level = np.sqrt(mean_around(squares, NOISE_REACH_SAMPLES) / 3.0)
            for nearest in (np.arange(count) - order // 2, np.arange(count) - (order + 1) // 2):
                here[channel] = np.minimum(here[channel], level[np.clip(nearest, 0, len(level) - 1)])
    falls = found[-1, 0] < FILTERED_NOISE_RATIO * found[MIDDLE_ORDER - DIFFERENCE_ORDERS[0], 0]
    agrees = found <= found.min(axis=(0, 1)) * (1.0 + AGREEING_RATIO / np.sqrt(count))
    position, rotation = np.where(falls, 0.0, found.mean(axis=(0, 1), where=agrees)).tolist()
    return Trembling(position, rotation, here)


def mean_around(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the mean of each of values (n,) and so many on either side of it, of fewer at the ends."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    at = np.arange(len(values))
    first, last = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(values))
    # A sum of what is not negative is not, whatever is rounded.
    return np.maximum(sums[last] - sums[first], 0.0) / (last - first)
