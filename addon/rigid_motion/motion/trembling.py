"""How much a recording trembles: the part of it that no motion explains.

White noise is as large in differences of any order, once they are divided by what they do to it; motion is the smaller
the higher the order, where samples come often enough. So the least of several orders is the noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .differences import coefficients, differences
from .poses import Poses

DIFFERENCE_ORDERS = range(3, 9)
"""Of the differences that are tried."""

QUIET_RATIO, QUIET_NORM = 0.25, 1.10123
"""This share of the differences are the quietest, and the norm below which a share of 0.25 of normal vectors (3,) are.
They leave hits and fast stretches out."""

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
    floors: list[list[float]] = []
    for order in DIFFERENCE_ORDERS:
        scaled = coefficients(times, order)
        scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
        floors.append([])
        for channel, each in enumerate(differences(poses, scaled)):
            squares = np.einsum("nc,nc->n", each, each)
            floors[-1].append(np.sqrt(np.quantile(squares, QUIET_RATIO)) / QUIET_NORM)
            level = np.sqrt(mean_around(squares, NOISE_REACH_SAMPLES) / 3.0)
            for nearest in (np.arange(count) - order // 2, np.arange(count) - (order + 1) // 2):
                here[channel] = np.minimum(here[channel], level[np.clip(nearest, 0, len(level) - 1)])
    found = np.array(floors)
    falls = found[-1] < FILTERED_NOISE_RATIO * found[MIDDLE_ORDER - DIFFERENCE_ORDERS[0]]
    position, rotation = np.where(falls, 0.0, found.min(axis=0)).tolist()
    return Trembling(position, rotation, here)


def mean_around(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the mean of each of values (n,) and so many on either side of it, of fewer at the ends."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    at = np.arange(len(values))
    first, last = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(values))
    # A sum of what is not negative is not, whatever is rounded.
    return np.maximum(sums[last] - sums[first], 0.0) / (last - first)
