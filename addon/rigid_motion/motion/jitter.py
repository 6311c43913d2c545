"""The jitter of a recording: the part that no motion explains.

Normalised differences of any order keep the size of white noise, while motion shrinks with the order if samples are
frequent enough. So the noise is the smallest estimate from several orders and fractions of the samples. As the smallest
of several correct estimates would be too small, the result is the mean of all estimates that agree with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .differences import coefficients, differences
from .poses import Poses

DIFFERENCE_ORDERS = range(3, 9)
"""The orders of differences that give estimates."""

QUIET_RATIOS, QUIET_NORMS = (0.25, 0.5, 0.75), (1.10123, 1.53817, 2.02691)
"""Fractions of the differences, the smallest ones, and the same quantiles of the norms of standard normal vectors (3,).
They leave out impacts and fast stretches."""

AGREEING_RATIO = 2.2
"""Divided by the square root of the sample count: the fraction by which an estimate may exceed the smallest and agree.
Twice the standard deviation of an estimate in white noise."""

FILTERED_NOISE_RATIO = 0.8
"""If the estimate of the highest order is below this fraction of that of `MIDDLE_ORDER`, the noise was filtered out."""

MIDDLE_ORDER = 5

NOISE_REACH_SAMPLES = 8
"""Samples on either side that define the jitter at a sample."""


class Jitter(NamedTuple):
    """Jitter of positions, metres, and of rotations, radians: standard deviations along an axis, 0 if none is found.

    `here` has both for each sample, shape (2, n). They are larger where motion cannot be distinguished from jitter.
    """

    position: float
    rotation: float
    here: np.ndarray


def jitter(times: np.ndarray, poses: Poses) -> Jitter:
    """Return the jitter of a recording with times (n,) in seconds and poses (n,) with unit quaternions.

    It needs `DIFFERENCE_ORDERS[-1] + 2` samples; with fewer, no jitter is found.
    """
    count = len(times)
    here = np.full((2, count), np.inf)
    if count <= DIFFERENCE_ORDERS[-1] + 1:
        return Jitter(0.0, 0.0, np.zeros((2, count)))
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
    return Jitter(position, rotation, here)


def mean_around(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the mean of each of values (n,) and its `reach` neighbours on either side, fewer at the ends."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    at = np.arange(len(values))
    first, last = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(values))
    # Rounding must not make a sum of non-negative values negative.
    return np.maximum(sums[last] - sums[first], 0.0) / (last - first)
