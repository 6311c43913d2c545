"""Divided differences of the positions and rotations of a recording, which are zero for steady motion.

Rotations are rotation vectors in world axes, relative to the rotation halfway between the two middle samples. So a
constant spin about a fixed axis has no second difference, and the differences turn with the world and not with time.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .poses import Poses
from .quaternions import conjugate, turned, turns_between


def coefficients(times: np.ndarray, order: int) -> np.ndarray:
    """Return the factors of each run of order + 1 samples, shape (n - order, order + 1), that give its derivative.

    Times (n,) rise strictly, evenly or not.
    """
    at = sliding_window_view(times, order + 1)
    apart = at[:, :, None] - at[:, None, :]
    apart[:, range(order + 1), range(order + 1)] = 1.0
    return np.prod(np.arange(1.0, order + 1.0)) / apart.prod(axis=-1)


def differences_of_positions(positions: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return differences (n - order, 3) of positions (n, 3)."""
    return np.einsum("nk,nck->nc", coefficients, sliding_window_view(positions, coefficients.shape[1], axis=0))


def differences_of_rotations(quaternions: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return differences (n - order, 3) in radians of rotations (n, 4), in world axes."""
    count, width = coefficients.shape
    # Seen from the body, the world rotates about world axes.
    seen = conjugate(quaternions)
    before, behind = seen[(width - 1) // 2 :][:count], seen[width // 2 :][:count]
    centre = turned(before, 0.5 * turns_between(before, behind))
    turns = turns_between(sliding_window_view(seen, width, axis=0).swapaxes(1, 2), centre[:, None])
    return np.einsum("nk,nkc->nc", coefficients, turns)


def turned_in_world(quaternions: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return rotations (..., 4) turned by rotation vectors (..., 3) in world axes."""
    return conjugate(turned(conjugate(quaternions), -turns))


def differences(poses: Poses, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the differences of positions and of rotations."""
    return (
        differences_of_positions(poses.positions, coefficients),
        differences_of_rotations(poses.quaternions, coefficients),
    )
