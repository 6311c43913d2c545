"""Easings: Robert Penner's equations on arrays, in Blender's form.

Time and value both run from 0 to 1 over a segment. Each easing is defined once, as ease-in; ease-out is that rotated
about the middle of the segment, and in-out is one half of each. The names are those of
`bpy.types.Keyframe.interpolation` and `.easing`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def ease(interpolation: str, easing: str, u: np.ndarray, back: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the fraction of a segment's change that is done at `u`.

    Parameters
    ----------
    interpolation : str
        A key of `EASE_IN`.
    easing : str
        AUTO (EASE_OUT for BACK and BOUNCE, EASE_IN for the others), EASE_IN, EASE_OUT or EASE_IN_OUT.
    u : array, shape (n,)
        Time in the segment, 0 to 1.
    back : float or array, shape (n,)
        The overshoot of BACK, as Blender measures it.

    Returns
    -------
    array, shape (n,)
        0 at the start and 1 at the end; BACK leaves this range in between.
    """
    easing = _AUTO_EASINGS.get(interpolation, "EASE_IN") if easing == "AUTO" else easing
    if interpolation == "BACK" and easing == "EASE_IN_OUT":
        back = 1.525 * back
    ease_in = EASE_IN[interpolation]
    return _directed(lambda time: ease_in(time, back), easing, u, 1.0)


def elastic(
    easing: str,
    u: np.ndarray,
    change: np.ndarray | float,
    amplitude: np.ndarray | float,
    period: np.ndarray | float,
) -> np.ndarray:
    """Return the change of value by ELASTIC at `u`.

    Parameters
    ----------
    easing : str
        AUTO (EASE_OUT), EASE_IN, EASE_OUT or EASE_IN_OUT.
    u : array, shape (n,)
        Time in the segment, 0 to 1.
    change : float or array, shape (n,)
        Change of value over the segment. Falling is not rising upside down: the swings differ in phase.
    amplitude : float or array, shape (n,)
        Largest swing, in units of value. If it is less than the change, swings shrink in proportion.
    period : float or array, shape (n,)
        The length of one swing, as a fraction of the segment's duration. 0 for Blender's default, 0.3 (in-out: 0.45).

    Returns
    -------
    array, shape (n,)
        0 at the start and `change` at the end.
    """
    change, amplitude = np.asarray(change), np.asarray(amplitude)
    period = np.where(period == 0.0, 0.45 if easing == "EASE_IN_OUT" else 0.3, period)
    weak = (amplitude == 0.0) | (amplitude < np.abs(change))
    swing = np.where(weak, change, amplitude)
    with np.errstate(divide="ignore", invalid="ignore"):
        lag = period * np.where(weak, 0.25, np.arcsin(change / amplitude) / (2.0 * np.pi))
        shrunk = np.where(weak & (change != 0.0), amplitude / np.abs(change), 1.0)

    def ease_in(time: np.ndarray) -> np.ndarray:
        left = time - 1.0
        # A weak swing grows to full size close to the key; otherwise it would not reach the key.
        near = np.abs(left) < np.abs(lag)
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.where(near, 1.0 + (shrunk - 1.0) * np.abs(left / lag), shrunk)
            moved = swing * np.exp2(10.0 * left) * np.sin((lag - left) * (2.0 * np.pi / period))
        return np.where(time == 0.0, 0.0, size * moved)

    return _directed(ease_in, "EASE_OUT" if easing == "AUTO" else easing, u, change)


def _directed(
    ease_in: Callable[[np.ndarray], np.ndarray], easing: str, u: np.ndarray, change: np.ndarray | float
) -> np.ndarray:
    """Return the values of a function that eases in from 0 to `change`, converted to ease in, out, or in and out."""
    if easing == "EASE_IN":
        return ease_in(u)
    if easing == "EASE_OUT":
        return change - ease_in(1.0 - u)
    first = u < 0.5
    half = 0.5 * ease_in(2.0 * np.where(first, u, 1.0 - u))
    return np.where(first, half, change - half)


def _back(u: np.ndarray, back: np.ndarray | float) -> np.ndarray:
    return u * u * ((back + 1.0) * u - back)


def _bounce(u: np.ndarray, _: object) -> np.ndarray:
    """Return four parabolas, each with its vertex where the ball is highest; the first is only half of one."""
    left = 1.0 - u
    arc = np.searchsorted((1.0 / 2.75, 2.0 / 2.75, 2.5 / 2.75), left, side="right")
    top = np.array((0.0, 1.5 / 2.75, 2.25 / 2.75, 2.625 / 2.75))[arc]
    height = np.array((0.0, 0.75, 0.9375, 0.984375))[arc]
    return 1.0 - (2.75**2 * (left - top) ** 2 + height)


EASE_IN: dict[str, Callable[[np.ndarray, np.ndarray | float], np.ndarray]] = {
    "SINE": lambda u, _: 1.0 - np.cos(0.5 * np.pi * u),
    "QUAD": lambda u, _: u**2,
    "CUBIC": lambda u, _: u**3,
    "QUART": lambda u, _: u**4,
    "QUINT": lambda u, _: u**5,
    "EXPO": lambda u, _: np.expm1(10.0 * np.log(2.0) * u) / 1023.0,
    "CIRC": lambda u, _: 1.0 - np.sqrt(1.0 - u**2),
    "BACK": _back,
    "BOUNCE": _bounce,
}
"""Functions from time and BACK's overshoot to value, easing in. ELASTIC is missing: it depends on the change's size."""

_AUTO_EASINGS = {"BACK": "EASE_OUT", "BOUNCE": "EASE_OUT"}
