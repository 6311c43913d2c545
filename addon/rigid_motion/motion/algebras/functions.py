"""Scalar functions in the logarithms and exponentials of motions, accurate down to an angle of zero."""

from __future__ import annotations

import numpy as np

SERIES_BELOW = 0.1
"""Angle in radians below which the power series is used. There the next term of the series is below 1e-15. So is the
cancellation error of the direct forms at this angle, counting their factor, the square of the angle."""


def sinc(h: np.ndarray) -> np.ndarray:
    """Return sin(h) / h."""
    return np.sinc(h / np.pi)


def sinc_slope(h: np.ndarray) -> np.ndarray:
    """Return (cos(h) - sin(h) / h) / h^2, the derivative of sinc divided by h."""
    h2 = h * h
    series = -1.0 / 3.0 + h2 * (1.0 / 30.0 - h2 * (1.0 / 840.0 - h2 * (1.0 / 45360.0 - h2 / 3991680.0)))
    far = np.where(h < SERIES_BELOW, 1.0, h)
    return np.where(h < SERIES_BELOW, series, (np.cos(far) - np.sin(far) / far) / (far * far))


def log_slope(h: np.ndarray) -> np.ndarray:
    """Return (sin(h) cos(h) - h) / sin(h)^3, for h from 0 to pi / 2."""
    h2 = h * h
    near = -2.0 / 3.0 - h2 * (
        1.0 / 5.0
        + h2 * (17.0 / 420.0 + h2 * (29.0 / 4200.0 + h2 * (1181.0 / 1108800.0 + h2 * 1393481.0 / 9081072000.0)))
    )
    far = np.where(h < SERIES_BELOW, 1.0, h)
    return np.where(h < SERIES_BELOW, near, (np.sin(far) * np.cos(far) - far) / np.sin(far) ** 3)


def growth(z: np.ndarray) -> np.ndarray:
    """Return (exp(z) - 1) / z for complex z: the mean of exp(z x) over x in [0, 1]."""
    half = np.where(z == 0, 1.0, z / 2.0)
    sinh = np.sinh(half.real) * np.cos(half.imag) + 1j * np.cosh(half.real) * np.sin(half.imag)
    return np.where(z == 0, 1.0, np.exp(half) * sinh / half)
