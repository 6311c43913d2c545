"""Intrinsic Euler angles converted to quaternions, for formats with rotations about one axis after another."""

from __future__ import annotations

import numpy as np

from rigid_motion.motion.quaternions import multiply


def quaternions_from_intrinsic_eulers(angles: np.ndarray, order: str) -> np.ndarray:
    """Return the rotations R1 R2 ... about the axes in `order`, each axis as moved by the earlier rotations.

    Parameters
    ----------
    angles : array, shape (n, len(order))
        Radians.
    order : str
        One letter of X, Y, Z for each column of `angles`: "YXZ" is A-Frame's order, "ZXY" the common one in BVH.

    Returns
    -------
    array, shape (n, 4)
        w, x, y, z. NaN if an angle is infinite or NaN.
    """
    result = np.tile((1.0, 0.0, 0.0, 0.0), (len(angles), 1))
    for column, axis in enumerate(order):
        turn = np.zeros_like(result)
        with np.errstate(invalid="ignore"):
            turn[:, 0] = np.cos(angles[:, column] / 2.0)
            turn[:, 1 + "XYZ".index(axis)] = np.sin(angles[:, column] / 2.0)
        result = multiply(result, turn)
    return result
