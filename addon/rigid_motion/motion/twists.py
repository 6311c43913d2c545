"""Twists: velocities of rigid bodies, with their exponential and logarithm.

A twist has six numbers: the angular velocity and the velocity of the body's origin, both along the body's own axes. Its
exponential is the motion of a body that keeps this velocity for one unit of time. The logarithm of a motion is the
twist that leads there by the shorter turn. Components come first, as in `rigid_motion.motion.segments`.

Source: Murray, Li and Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, chapter 2.
"""

from __future__ import annotations

import numpy as np

from .quaternions import conjugate, cross, multiply, rotate
from .trigonometry import fill_sine_and_cosine

ZERO_ANGLE_SQUARED = 1e-200
"""Replaces the square of an angle of zero where only ratios count."""


def exponential(twists: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the motions (n) of twists (6, n): unit quaternions (4, n) and translations (3, n)."""
    turn, advance = twists[:3], twists[3:]
    squared = np.einsum("kn,kn->n", turn, turn)
    np.maximum(squared, ZERO_ANGLE_SQUARED, out=squared)
    angle = np.sqrt(squared)
    sine, quaternions = np.empty_like(angle), np.empty((4, twists.shape[1]))
    fill_sine_and_cosine(0.5 * angle, sine, quaternions[0], narrow=False)
    np.multiply(sine / angle, turn, out=quaternions[1:])
    # Factors of the angle a: sin(a) / a, (1 - cos(a)) / a^2 and (1 - sin(a) / a) / a^2. For small angles the last has
    # few correct digits, but its product is nearly zero.
    along = 2.0 * sine * quaternions[0] / angle
    translations = cross(turn, advance)
    translations *= 2.0 * sine * sine / squared
    translations += along * advance
    translations += np.einsum("kn,kn->n", turn, advance) * (1.0 - along) / squared * turn
    return quaternions, translations


def logarithm(quaternions: np.ndarray, translations: np.ndarray, *, shortest: bool = True) -> np.ndarray:
    """Return the twists (6, n) of motions: unit quaternions (4, n) and translations (3, n).

    With `shortest`, they turn the shorter way. Otherwise the sign of the quaternion decides: a negative first component
    means more than half a turn.
    """
    sine = np.sqrt(np.einsum("kn,kn->n", quaternions[1:], quaternions[1:]))
    np.maximum(sine, np.sqrt(ZERO_ANGLE_SQUARED), out=sine)
    cosine = np.abs(quaternions[0]) if shortest else quaternions[0]
    angle = 2.0 * np.arctan2(sine, cosine)
    ratio = angle / sine
    turn = np.where(cosine != quaternions[0], -ratio, ratio) * quaternions[1:]
    across = cross(turn, translations)
    # A factor of the angle a: (1 - (a / 2) cot(a / 2)) / a^2. For small angles it has few correct digits, as in
    # `exponential`.
    bend = (1.0 - 0.5 * ratio * cosine) / (angle * angle)
    return np.concatenate((turn, translations - 0.5 * across + bend * cross(turn, across)))


def between(
    first_positions: np.ndarray,
    first: np.ndarray,
    second_positions: np.ndarray,
    second: np.ndarray,
    *,
    shortest: bool = True,
) -> np.ndarray:
    """Return the twists (6, n) from first to second poses in one unit of time: positions (n, 3), quaternions (n, 4)."""
    back = conjugate(first)
    return logarithm(multiply(back, second).T, rotate(back, second_positions - first_positions).T, shortest=shortest)
