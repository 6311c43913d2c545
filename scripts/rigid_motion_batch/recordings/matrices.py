"""Rigid poses from matrices that may contain scale and shear, or hide an object by a scale of 0.

The position of a matrix is kept, and so is the direction of its y axis, which runs along a bone. x is made orthogonal
to y, z orthogonal to both, and all have length 1.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs, from_matrices

SHORTEST_AXIS = 1e-12
"""Length below which an axis has no direction: bones are hidden by a scale of 0."""

MAX_STEADY_SCALE_RATIO = 1e-4
"""Ratio by which a constant scale may vary: single precision, through a chain of matrices."""


def rigid(matrices: np.ndarray) -> Poses:
    """Return the rigid poses of matrices (..., 4, 4). The quaternion is NaN if the x or y axis has no length."""
    return rigid_of(matrices[..., :3, :3], matrices[..., :3, 3])


def rigid_of(axes: np.ndarray, origins: np.ndarray) -> Poses:
    """Return the rigid poses of axes, the columns of (..., 3, 3), and origins (..., 3)."""
    with np.errstate(invalid="ignore", over="ignore"):
        y, x = _unit(axes[..., 1]), _unit(axes[..., 0])
        x = _unit(x - np.sum(x * y, axis=-1, keepdims=True) * y)
        return Poses(origins, from_matrices(np.stack([x, y, np.cross(x, y)], axis=-1)))


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > SHORTEST_AXIS, lengths, np.nan)


def scales_of(axes: np.ndarray) -> np.ndarray:
    """Return the mean lengths of axes, the columns of (..., 3, 3), shape (...)."""
    with np.errstate(over="ignore"):
        return np.linalg.norm(axes, axis=-2).mean(axis=-1)


def growing(poses: Poses) -> Poses:
    """Return poses (n,), without scales if these are constant: then they are the unit that the file was made in."""
    scales = poses.scales
    steady = scales is None or np.allclose(scales, scales[0], rtol=MAX_STEADY_SCALE_RATIO, atol=0.0)
    return Poses(poses.positions, poses.quaternions) if steady else poses


def filled(poses: Poses) -> Poses:
    """Return poses (bones, n), each missing quaternion replaced by the last before, else the first after, or no
    rotation.

    Signs are aligned.
    """
    for own in poses.quaternions:
        good = np.isfinite(own).all(axis=-1)
        if good.all():
            continue
        if not good.any():
            own[:] = (1.0, 0.0, 0.0, 0.0)
            continue
        last = np.maximum.accumulate(np.where(good, np.arange(len(own)), -1))
        own[:] = own[np.where(last >= 0, last, np.argmax(good))]
    return Poses(poses.positions, align_signs(poses.quaternions), poses.scales)
