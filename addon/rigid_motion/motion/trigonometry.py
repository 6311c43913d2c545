"""Fast sines and cosines of many angles at once.

In double precision NumPy takes 8 to 9 ns for a sine, and as much for a cosine, on every processor. Its tangent takes
1 ns with vector code (AVX-512), and gives both by the half-angle formulas. Otherwise a polynomial gives the sine of a
small angle, and a square root its cosine. All are correct to a few units in the last place.
"""

from __future__ import annotations

import numpy as np

MAX_NARROW_RAD = np.pi / 3.0
"""The largest angle in radians for which the polynomial equals the sine, and the root keeps the cosine's precision."""

_SINE_COEFFICIENTS = (
    -0.16666666666666666,
    0.008333333333332985,
    -0.00019841269840999382,
    2.7557319124112555e-06,
    -2.5052088620602564e-08,
    1.605689019222814e-10,
    -7.525258784607096e-13,
)
"""Coefficients of sin(x) / x - 1 in powers of x^2, with the smallest relative error of the sine up to `MAX_NARROW_RAD`,
2.1e-19 (Remez)."""


def _has_vector_tangent() -> bool:
    """Whether NumPy has vector code for the tangent, beyond the C library's scalar one. False for NumPy before 2.1."""
    introspect = getattr(np.lib, "introspect", None)
    if introspect is None:
        return False
    result = introspect.opt_func_info(func_name="^tan$", signature="float64")
    return not all(loop["current"].startswith("baseline") for loops in result.values() for loop in loops.values())


VECTOR_TANGENT = _has_vector_tangent()


def fill_sine_and_cosine(angles: np.ndarray, sine: np.ndarray, cosine: np.ndarray, *, narrow: bool) -> None:
    """Fill `sine` and `cosine` from angles in radians. The three arrays must not share memory.

    `narrow` asserts that no angle exceeds `MAX_NARROW_RAD`, except for rounding. The caller decides this: if this
    function tested all angles, the last bit of one sine would depend on the other angles.
    """
    if narrow and not VECTOR_TANGENT:
        np.multiply(angles, angles, out=cosine)
        np.multiply(cosine, _SINE_COEFFICIENTS[-1], out=sine)
        for coefficient in _SINE_COEFFICIENTS[-2::-1]:
            sine += coefficient
            sine *= cosine
        sine += 1.0
        sine *= angles
        np.multiply(sine, sine, out=cosine)
        np.subtract(1.0, cosine, out=cosine)
        np.sqrt(cosine, out=cosine)
        return
    # With t, the tangent of half the angle: 2 t / (1 + t^2) and 2 / (1 + t^2) - 1. No double is at a pole of the
    # tangent, and next to a pole t is 1.6e16.
    np.multiply(angles, 0.5, out=sine)
    np.tan(sine, out=sine)
    np.multiply(sine, sine, out=cosine)
    cosine += 1.0
    np.divide(2.0, cosine, out=cosine)
    sine *= cosine
    cosine -= 1.0
