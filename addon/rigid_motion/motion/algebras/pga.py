"""Poses as motors of 3D projective geometric algebra (PGA), with their LERP and SLERP.

The basis vectors square to e0^2 = 0, e1^2 = e2^2 = e3^2 = 1. A pose is the motor M = T R with T = 1 - e0 (t1 e1 + t2 e2
+ t3 e3) / 2. The quaternion w, x, y, z is R = w - z e12 + y e13 - x e23, as in the paper.
"""

from __future__ import annotations

import numpy as np

from ..poses import Poses
from .functions import log_slope, sinc, sinc_slope
from .multivectors import Algebra
from .vector_quaternion import geometric_scales

PGA = Algebra({"0": 0, "1": 1, "2": 1, "3": 1})

_ROTOR = PGA.indices("1", "e12", "e13", "e23")
_ROTATION = PGA.indices("e23", "e13", "e12")
_TRANSLATION = PGA.indices("e01", "e02", "e03")
_SCALAR, _PSEUDOSCALAR = PGA.indices("1", "e0123")


def pga_lerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return (1 - u) M0 + u M1, normalised by `extract`."""
    u = np.asarray(u)[..., None]
    motor = (1.0 - u) * encode(first) + u * encode(second)
    return extract(motor, geometric_scales(first, second, u[..., 0]))


def pga_slerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return M0 exp(u log(M0^-1 M1))."""
    u = np.asarray(u)
    start, end = encode(first), encode(second)
    bivector = logarithm(PGA.product(PGA.reverse(start), end))
    return extract(PGA.product(start, exponential(u[..., None] * bivector)), geometric_scales(first, second, u))


def encode(poses: Poses) -> np.ndarray:
    """Return the motors T R, shape (..., 16)."""
    t1, t2, t3 = np.moveaxis(poses.positions, -1, 0)
    w, x, y, z = np.moveaxis(poses.quaternions, -1, 0)
    translator = PGA.multivector(one=1.0, e01=-t1 / 2.0, e02=-t2 / 2.0, e03=-t3 / 2.0)
    return PGA.product(translator, PGA.multivector(one=w, e12=-z, e13=y, e23=-x))


def extract(motor: np.ndarray, scales: np.ndarray | None = None) -> Poses:
    """Return R = a + b e12 + c e13 + d e23 from e0 M = e0 R, then T = M R^-1; the motor need not be normalised.

    The paper writes the reverse for R^-1, which holds for unit R. The R of a LERP is not a unit, hence the division.
    """
    rotor = np.zeros_like(motor)
    rotor[..., _ROTOR] = motor[..., _ROTOR]
    squared = np.sum(rotor * rotor, axis=-1, keepdims=True)
    translator = PGA.product(motor, PGA.reverse(rotor) / squared)
    a, b, c, d = np.moveaxis(rotor[..., _ROTOR] / np.sqrt(squared), -1, 0)
    return Poses(-2.0 * translator[..., _TRANSLATION], np.stack((a, -d, c, -b), axis=-1), scales)


def logarithm(motor: np.ndarray) -> np.ndarray:
    """Return the bivector whose exponential is a unit motor with non-negative scalar.

    A motor is s + b + p I, where the square of the bivector b is a scalar plus a multiple of I. The function h / sin h
    of that "Study number" has two parts: f scales b, and f' adds a multiple of the rotation of b to its translation.
    """
    scalar, pseudoscalar = motor[..., [_SCALAR]], motor[..., [_PSEUDOSCALAR]]
    bivector = motor.copy()
    bivector[..., [_SCALAR, _PSEUDOSCALAR]] = 0.0
    half_angle = np.arctan2(np.linalg.norm(motor[..., _ROTATION], axis=-1, keepdims=True), scalar)
    slope = log_slope(half_angle) * _pitch(bivector) + pseudoscalar
    return bivector / sinc(half_angle) - slope * _moment(bivector)


def exponential(bivector: np.ndarray) -> np.ndarray:
    """Return the unit motor of a bivector."""
    h = np.linalg.norm(bivector[..., _ROTATION], axis=-1, keepdims=True)
    motor = sinc(h) * bivector - sinc_slope(h) * _pitch(bivector) * _moment(bivector)
    motor[..., [_SCALAR]] = np.cos(h)
    motor[..., [_PSEUDOSCALAR]] = sinc(h) * _pitch(bivector)
    return motor


def _moment(bivector: np.ndarray) -> np.ndarray:
    """Return I b: the rotation part of a bivector as a translation along its axis."""
    return PGA.product(PGA.multivector(e0123=1.0), bivector)


def _pitch(bivector: np.ndarray) -> np.ndarray:
    """Return the coefficient of I in b^2 / 2: the translation along the rotation axis times the rotation."""
    return PGA.product(bivector, bivector)[..., [_PSEUDOSCALAR]] / 2.0
