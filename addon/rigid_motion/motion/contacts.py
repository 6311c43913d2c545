"""Contacts: which joints of a body stand on the ground, and how far they slide there.

When a foot that stood still in the recording moves, viewers notice that first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .poses import numbers

MAX_STANDING_HEIGHT_RATIO = 0.12
"""Greatest height of a standing joint above the lowest point of any joint, as a fraction of the body's height."""

MAX_STANDING_HEIGHTS_PER_S = 0.06
"""Greatest speed of a standing joint, in heights of the body per second: 10 cm/s for an adult."""

MIN_STANDING_S = 0.1
"""Shortest time that counts as standing, in seconds: shorter stops are turning points."""


def standing(times: ArrayLike, positions: ArrayLike, *, shaky: bool = False) -> np.ndarray:
    """Return which joints stand on the ground, and when.

    Parameters
    ----------
    times : array-like, shape (n,)
        Seconds, strictly rising.
    positions : array-like, shape (joints, n, 3)
        In the world, with the third axis upwards, in any unit: low and slow are relative to the body's height.
    shaky : bool
        Whether the positions jitter: then averages over twice the shortest time of standing are used.

    Returns
    -------
    array of bool, shape (joints, n)
        Where a joint is low and slow for long enough.

    Raises
    ------
    ValueError
        If the shapes do not fit one another.

    See Also
    --------
    reduce_skeleton_keys : Uses it for weights: standing feet count for more.
    clean : Lets standing feet slide no further than they did.

    Examples
    --------
    A head that moves on, and a foot that stands for half a second:

    >>> import numpy as np
    >>> from rigid_motion.motion import standing
    >>> times = np.arange(11) / 10
    >>> head = np.stack((times, 0 * times, 1.7 + 0 * times), axis=1)
    >>> foot = np.stack((np.maximum(times - 0.5, 0), 0 * times, 0 * times), axis=1)
    >>> standing(times, [head, foot]).sum(axis=1).tolist()
    [0, 5]
    """
    times, positions = numbers(times, "times"), numbers(positions, "positions")
    if positions.ndim != 3 or (*times.shape, 3) != positions.shape[1:]:
        raise ValueError(f"positions of shape {positions.shape} need the shape (joints, {times.size}, 3)")
    if len(times) < 2:
        return np.zeros(positions.shape[:2], dtype=bool)
    for _ in range(2 * shaky):
        reach, at = round(MIN_STANDING_S / 2.0 / float(np.median(np.diff(times)))), np.arange(len(times))
        first, last = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(at))
        sums = np.cumsum(np.pad(positions, ((0, 0), (1, 0), (0, 0))), axis=1)
        positions = (sums[:, last] - sums[:, first]) / (last - first)[:, None]
    heights = positions[..., 2]
    height = float(np.median(np.ptp(heights, axis=0)))
    ways = np.linalg.norm(np.diff(positions, axis=1), axis=-1)
    slow = ways <= MAX_STANDING_HEIGHTS_PER_S * height * np.diff(times)
    return contacts(times, heights - heights.min() <= MAX_STANDING_HEIGHT_RATIO * height, slow)


def contacts(times: np.ndarray, low: np.ndarray, slow: np.ndarray) -> np.ndarray:
    """Return when joints stand, given when they are low (joints, n) and slow between samples (joints, n - 1)."""
    stands = low & np.concatenate((slow[:, :1], slow), axis=1) & np.concatenate((slow, slow[:, -1:]), axis=1)
    for joint, first, last in spans(stands):
        if times[last] - times[first] < MIN_STANDING_S:
            stands[joint, first : last + 1] = False
    return stands


def slide_ratios(positions: np.ndarray, before: np.ndarray, stands: np.ndarray, allowed: float = 0.0) -> np.ndarray:
    """Return how far joints are from where they first stood, over how far they may be (joints, n); 0 where none stands.

    They may be as far as they were at most in the positions `before` (joints, n, 3), or as far as `allowed`, but for
    rounding. The first sample of each time of standing has the largest ratio of that time.
    """
    ratios, least = np.zeros(stands.shape), 1e-9 * float(np.abs(before).max(initial=0.0)) + 1e-99
    for joint, first, last in spans(stands):
        rows = slice(first, last + 1)
        now, own = (np.linalg.norm(each[joint, rows] - each[joint, first], axis=-1) for each in (positions, before))
        ratios[joint, rows] = now / (max(np.max(own), allowed) + least)
        ratios[joint, first] = np.max(ratios[joint, rows])
    return ratios


def slide(positions: np.ndarray, stands: np.ndarray) -> float:
    """Return the greatest distance of a joint (joints, n, 3) from where it first stood, while it stands (joints, n)."""
    farthest = 0.0
    for joint, first, last in spans(stands):
        away = positions[joint, first : last + 1] - positions[joint, first]
        farthest = max(farthest, float(np.linalg.norm(away, axis=-1).max()))
    return farthest


def spans(stands: np.ndarray) -> list[tuple[int, int, int]]:
    """Return joint, first and last sample of every marked stretch of time (joints, n)."""
    edges = np.diff(stands.astype(np.int8), axis=1, prepend=0, append=0)
    joints, firsts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    return list(zip(joints.tolist(), firsts.tolist(), (ends - 1).tolist(), strict=True))
