"""Positions and rotations interpolated separately, the paper's state of the art: (1 - u) v + u w and q (q^-1 r)^u."""

from __future__ import annotations

import numpy as np

from ..poses import Poses
from ..quaternions import conjugate, multiply, normalise


def lerp_slerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return poses on the straight line between the positions and the great arc between the rotations."""
    u = np.asarray(u)[..., None]
    turned = multiply(first.quaternions, power(multiply(conjugate(first.quaternions), second.quaternions), u))
    return Poses((1.0 - u) * first.positions + u * second.positions, turned, geometric_scales(first, second, u[..., 0]))


def bezier(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return each number interpolated by itself with ease in and out, as Blender does between two keys alone."""
    u = np.clip(np.asarray(u), 0.0, 1.0)
    eased = (u * u * (3.0 - 2.0 * u))[..., None]
    position, quaternion = (
        (1.0 - eased) * a + eased * b
        for a, b in ((first.positions, second.positions), (first.quaternions, second.quaternions))
    )
    scales = None
    if first.scales is not None and second.scales is not None:
        scales = (1.0 - eased[..., 0]) * first.scales + eased[..., 0] * second.scales
    return Poses(position, normalise(quaternion), scales)


def power(q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return q^u = exp(u log q) of unit quaternions (n, 4) with non-negative w, for u of shape (n, 1)."""
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half_angle = np.arctan2(sine, q[..., :1])
    axis = q[..., 1:] / np.where(sine == 0.0, 1.0, sine)
    return np.concatenate((np.cos(u * half_angle), np.sin(u * half_angle) * axis), axis=-1)


def geometric_scales(first: Poses, second: Poses, u: np.ndarray) -> np.ndarray | None:
    """Return s0^(1 - u) s1^u, growth at a constant rate, or None if the poses have no scales."""
    if first.scales is None or second.scales is None:
        return None
    return np.exp((1.0 - u) * np.log(first.scales) + u * np.log(second.scales))
