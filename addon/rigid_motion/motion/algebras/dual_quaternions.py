"""Poses as unit dual quaternions d = A + eps B, shape (..., 8), with the screw motion between them (ScLERP).

A is the rotation r, and the translation t is 2 B A*. A unit dual quaternion is the exponential of a dual vector: its
real part is half the angle of the screw along its axis, its dual part half the moment and the pitch (Kavan et al.,
"Geometric skinning with approximate dual quaternion blending", 2008).
"""

from __future__ import annotations

import numpy as np

from ..poses import Poses
from ..quaternions import conjugate, multiply
from .functions import log_slope, sinc, sinc_slope
from .vector_quaternion import geometric_scales


def dq_sclerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return d0 (d0^-1 d1)^u, the SLERP of dual quaternions: the screw motion from one pose to the other."""
    u = np.asarray(u)
    start, end = encode(first), encode(second)
    screw = logarithm(product(inverse(start), end))
    return extract(product(start, exponential(u[..., None] * screw)), geometric_scales(first, second, u))


def encode(poses: Poses) -> np.ndarray:
    """Return the dual quaternions A = r, B = t r / 2."""
    pure = np.concatenate((np.zeros_like(poses.positions[..., :1]), poses.positions), axis=-1)
    return np.concatenate((poses.quaternions, 0.5 * multiply(pure, poses.quaternions)), axis=-1)


def extract(d: np.ndarray, scales: np.ndarray | None = None) -> Poses:
    """Return the rotation A and the translation, the vector part of 2 B A*."""
    real, dual = d[..., :4], d[..., 4:]
    return Poses(2.0 * multiply(dual, conjugate(real))[..., 1:], real, scales)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (A + eps B)(C + eps D) = A C + eps (A D + B C)."""
    return np.concatenate(
        (
            multiply(a[..., :4], b[..., :4]),
            multiply(a[..., :4], b[..., 4:]) + multiply(a[..., 4:], b[..., :4]),
        ),
        axis=-1,
    )


def inverse(d: np.ndarray) -> np.ndarray:
    """Return A* + eps B*, the inverse of a unit dual quaternion."""
    return np.concatenate((conjugate(d[..., :4]), conjugate(d[..., 4:])), axis=-1)


def logarithm(d: np.ndarray) -> np.ndarray:
    """Return the dual vector, shape (..., 6), whose exponential is d. Requires a non-negative w."""
    w, v, dual_w, dual_v = np.split(d, (1, 4, 5), axis=-1)
    half_angle = np.arctan2(np.linalg.norm(v, axis=-1, keepdims=True), w)
    # log d = f(d) v(d) with f = h / sin h; its dual part is f v' + f' v.
    f = 1.0 / sinc(half_angle)
    slope = log_slope(half_angle) * np.sum(v * dual_v, axis=-1, keepdims=True) - dual_w
    return np.concatenate((f * v, f * dual_v + slope * v), axis=-1)


def exponential(b: np.ndarray) -> np.ndarray:
    """Return the unit dual quaternion of a dual vector of shape (..., 6)."""
    real, dual = b[..., :3], b[..., 3:]
    h = np.linalg.norm(real, axis=-1, keepdims=True)
    along = np.sum(real * dual, axis=-1, keepdims=True)
    return np.concatenate(
        (np.cos(h), sinc(h) * real, -sinc(h) * along, sinc(h) * dual + sinc_slope(h) * along * real), axis=-1
    )
