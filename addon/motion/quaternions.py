"""Arrays of quaternions, w, x, y, z along the last axis. Hamilton's product, as in `mathutils`."""

from __future__ import annotations

import numpy as np


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton's product a b, shapes (..., 4): the rotation b first, then a. A view, components apart in memory."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    components = np.empty((4, *np.broadcast_shapes(aw.shape, bw.shape)))
    w, x, y, z = (components[row, ...] for row in range(4))
    np.subtract(aw * bw, ax * bx, out=w)
    w -= ay * by
    w -= az * bz
    np.add(aw * bx, ax * bw, out=x)
    x += ay * bz
    x -= az * by
    np.add(aw * by, ay * bw, out=y)
    y -= ax * bz
    y += az * bx
    np.add(aw * bz, az * bw, out=z)
    z += ax * by
    z -= ay * bx
    return np.moveaxis(components, 0, -1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """w, -x, -y, -z: the inverse of a unit quaternion."""
    return q * np.array((1.0, -1.0, -1.0, -1.0))


def rotate(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points of shape (..., 3) turned by unit quaternions of shape (..., 4)."""
    turned = 2.0 * np.cross(q[..., 1:], points)
    return points + q[..., :1] * turned + np.cross(q[..., 1:], turned)


def normalise(q: np.ndarray) -> np.ndarray:
    """Unit quaternions of the same directions. Every quaternion needs a length above zero."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def align_signs(q: np.ndarray) -> np.ndarray:
    """The same rotations, with signs such that each quaternion is in the hemisphere of the one before.

    q and -q are one rotation, but an in-between of q and -r runs the long way round. Shape (..., n, 4); the first
    quaternion of each list keeps its sign, and so does one at exactly 180 degrees from its predecessor.
    """
    flips = np.einsum("...i,...i->...", q[..., 1:, :], q[..., :-1, :]) < 0.0
    if not flips.any():
        return q
    aligned = q.copy()
    aligned[..., 1:, :] *= 1.0 - 2.0 * (np.cumsum(flips, axis=-1) % 2)[..., None]
    return aligned


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angle in radians, 0 to pi, of the rotation that takes a to b. Accurate for tiny angles too."""
    difference = multiply(conjugate(a), b)
    return 2.0 * np.arctan2(np.linalg.norm(difference[..., 1:], axis=-1), np.abs(difference[..., 0]))
