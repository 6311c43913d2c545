"""Speeds of bodies: distances and turns from moment to moment, and sudden changes of velocity."""

from __future__ import annotations

import numpy as np

from .affine import AffineMaps

MIN_LENGTH = 1e-12
"""Shorter axes have no direction."""

NEAR_STEPS = 8
"""Steps on either side of a step that define the usual change there."""

ROUNDING_RATIO = 1e-5
"""Jumps below this fraction of the body's whole movement count as rounding."""


def ways_and_turns(maps: AffineMaps) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances and the angles in radians from each of n moments to the next, both of shape (n - 1,)."""
    axes = _directions(maps.axes)
    # The Frobenius norm of the difference of two rotations by an angle a is sqrt(8) sin(a / 2).
    apart = np.sqrt(np.square(np.diff(axes, axis=0)).sum(axis=(1, 2)) / 8.0)
    return np.linalg.norm(np.diff(maps.origins, axis=0), axis=1), 2.0 * np.arcsin(np.minimum(apart, 1.0))


def jumps(maps: AffineMaps, size: float) -> np.ndarray:
    """Return the ratio of the velocity change at each of n evenly spaced moments to the usual change near it.

    Parameters
    ----------
    maps : AffineMaps, shape (n,)
    size : float
        The distance from the origin of the measured points on the axes; the largest change of any point counts.

    Returns
    -------
    array, shape (n,)
        1 for a usual change, 0 at both ends. The usual change is the median of the changes nearby, without the adjacent
        ones, as a pop makes three large changes.
    """
    result = np.zeros(len(maps.origins))
    if len(result) < 3:
        return result
    points = np.concatenate((maps.origins[None], *(maps.origins + size * _directions(maps.axes).transpose(2, 0, 1),)))
    points = points.reshape(-1, len(result), 3)
    changes = np.linalg.norm(np.diff(points, n=2, axis=1), axis=2).max(axis=0)
    padded = np.pad(changes, NEAR_STEPS, constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEAR_STEPS + 1).copy()
    around[:, NEAR_STEPS - 2 : NEAR_STEPS + 3] = np.nan
    with np.errstate(all="ignore"):
        usual = np.nan_to_num(np.nanmedian(around, axis=1)) if len(changes) > NEAR_STEPS else np.median(changes)
    least = ROUNDING_RATIO * (float(np.ptp(points, axis=1).max()) or 1.0)
    result[1:-1] = changes / np.maximum(usual, least)
    return result


def _directions(axes: np.ndarray) -> np.ndarray:
    """Return axes (n, 3, 3) normalised to length 1, as columns."""
    return axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), MIN_LENGTH)
