"""Solvers for Bezier segments: the parameter at which a segment reaches a time, and handles through given values."""

from __future__ import annotations

import numpy as np

NEWTON_TOLERANCE = 1e-5
"""The size of a step below which Newton's method stops: the remaining error is about its square."""

NEWTON_STEPS = 4
"""The number of steps of Newton's method before bisection helps it."""

BRACKETED_STEPS = 100
"""The largest number of steps with bisection: more than bisection alone needs for the last bit."""

IN_TIME = (1.0 / 3.0, 2.0 / 3.0)
"""The times of handles that make a segment a cubic in time."""

MAX_ROOT_ERROR = 1e-6
"""Handles with a smaller error are not replaced by better ones: a few times single-precision rounding."""

LEAST_PULL = 1e-6
"""Changes of handles with a smaller effect, relative to the largest, are left out of the least-squares fit."""


def bezier_cubics(start: np.ndarray, right: np.ndarray, left: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return Bezier curves as cubics, after the correction that keeps frames from running backwards.

    Parameters
    ----------
    start, right, left, end : array, shape (k, 2)
        Key, its right handle, the left handle of the next key, and that key. In single precision: Blender's rounding
        matters if frame numbers are large and segments short.

    Returns
    -------
    array, shape (3, k, 2)
        Coefficients of t, t^2 and t^3 for frame and value relative to the first key.
    """
    duration = end[:, :1] - start[:, :1]
    rises = [one[:, 1] - other[:, 1] for one, other in ((start, end), (right, left), (left, end))]
    flat = np.all(np.abs(rises) < np.finfo(np.float32).eps, axis=0)
    right, left = _shortened(start, right, duration), _shortened(end, left, duration)
    cubics = np.stack(
        (3.0 * (right - start), 3.0 * (start - 2.0 * right + left), end - start + 3.0 * (right - left))
    ).astype(np.float64)
    cubics[:, flat, 1] = 0.0
    return cubics


def _shortened(key: np.ndarray, handle: np.ndarray, duration: np.ndarray) -> np.ndarray:
    """Return the handle, shortened to be no longer in time than the segment."""
    arm = key - handle
    length = np.abs(arm[:, :1])
    long = length > duration
    return np.where(long, key - duration / length * arm, handle) if long.any() else handle


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def solve_cubics(u: np.ndarray, cubics: np.ndarray) -> np.ndarray:
    """Return the t from 0 to 1 at which the cubic c1 t + c2 t^2 + c3 t^3 is u.

    There is one for every u from 0 to 1: the cubic goes from 0 to 1, and as handles are no longer than the segment, it
    turns back only before it finally leaves 0 and after it has reached 1.

    Parameters
    ----------
    u : array, shape (m,)
        Time, 0 to 1.
    cubics : array, shape (3, m)
        c1, c2 and c3.

    Returns
    -------
    array, shape (m,)
        t, to about the square of `NEWTON_TOLERANCE`.
    """
    c1, c2, c3 = cubics
    twice, thrice = 2.0 * c2, 3.0 * c3
    # Newton's method, starting from the cubic in u through both ends with the slopes that t has there.
    at_start, at_end = (np.clip(1.0 / slope, 0.0, 3.0) for slope in (c1, c1 + twice + thrice))
    t = u * (at_start + u * (3.0 - 2.0 * at_start - at_end + u * (at_start + at_end - 2.0)))
    for _ in range(NEWTON_STEPS):
        step = (((c3 * t + c2) * t + c1) * t - u) / ((thrice * t + twice) * t + c1)
        t -= step
        np.abs(step, out=step)
        if step.max(initial=0.0) < NEWTON_TOLERANCE:
            break
    missed = np.flatnonzero(~((step < NEWTON_TOLERANCE) & (np.abs(t - 0.5) < 0.5 + NEWTON_TOLERANCE)))
    if len(missed):
        t[missed] = _solve_bracketed(u[missed], cubics[:, missed])
    return t


def _solve_bracketed(u: np.ndarray, cubics: np.ndarray) -> np.ndarray:
    """Solve cubics near a zero slope: by Newton steps, or by bisection if a step leaves the bracket."""
    c1, c2, c3 = cubics
    low, high = np.zeros_like(u), np.ones_like(u)
    t = np.clip(u, 0.0, 1.0)
    for _ in range(BRACKETED_STEPS):
        excess = ((c3 * t + c2) * t + c1) * t - u
        low, high = np.where(excess < 0.0, t, low), np.where(excess > 0.0, t, high)
        following = t - excess / ((3.0 * c3 * t + 2.0 * c2) * t + c1)
        following = np.where((following > low) & (following < high), following, 0.5 * (low + high))
        following = np.where(excess == 0.0, t, following)
        if not np.any(np.abs(following - t) > 1e-12):
            break
        t = following
    return t


def fit_together(times: np.ndarray, values: np.ndarray, shares: np.ndarray, native: np.ndarray) -> np.ndarray:
    """Return the handles of segments from (0, 0) to (1, 1) whose mean is nearest to `values` at `times`.

    Handles keep their times. If that is much better, every other segment becomes a cubic in time instead.

    Parameters
    ----------
    times, values : array, shape (m,)
        Times from 0 to 1.
    shares : array, shape (c,)
        The weight of each segment in the mean.
    native : array, shape (c, 2)
        The times of both handles.

    Returns
    -------
    array, shape (c, 2, 2)
        Time and value of both handles of each segment.
    """
    mixed = native.copy()
    mixed[np.argsort(-shares)[1::2]] = IN_TIME
    (best, least), (others, error) = (_nearest(x, times, values, shares) for x in (native, mixed))
    return others if error < 0.5 * least and least > MAX_ROOT_ERROR else best


def _nearest(x: np.ndarray, times: np.ndarray, values: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the handles (c, 2, 2) at these times (c, 2), and the largest error of their mean."""
    cubics = np.stack((3.0 * x[:, 0], 3.0 * (x[:, 1] - 2.0 * x[:, 0]), 1.0 + 3.0 * (x[:, 0] - x[:, 1])))
    t = solve_cubics(np.tile(times, len(x)), cubics.repeat(len(times), axis=1)).reshape(len(x), -1)
    pulls = np.stack((3.0 * t * (1.0 - t) ** 2, 3.0 * t * t * (1.0 - t)), axis=1)
    desired = values - t**3
    # Start with each segment fitted alone, and change it as little as possible.
    y = np.stack([np.linalg.lstsq(of_one.T, rest, rcond=None)[0] for of_one, rest in zip(pulls, desired, strict=True)])
    together = (shares[:, None, None] * pulls).reshape(-1, len(times))
    off = shares @ desired - y.ravel() @ together
    y += np.linalg.lstsq(together.T, off, rcond=LEAST_PULL)[0].reshape(y.shape)
    return np.stack((x, y), axis=2), float(np.abs(shares @ desired - y.ravel() @ together).max())
