"""How a smooth motion with handles passes its keys: how long its path's tangents are, and how fast it runs there.

The direction of the tangent at a key is that of the mode, a mean of the twists before and after it. How far the motion
has come in a segment is what the channels say, as in the other modes: their progress along the segment's chord. The
screws on both sides of a key differ in speed and direction. So the tangent is made as long on either side as the screw
is along the mean of both, which makes the speed the same where handles are smooth and the path is straight; what is
lacking on a bent path, for the speed that Blender's own in-betweens have in that direction, is added to the progress.
With two keys, and where no handle has a say, nothing changes.

Twists (6, S) are along the body's own axes at the key, a radian counting as much as a unit of length; segments stand
along the last axis.
"""

from __future__ import annotations

import numpy as np

from ...motion import Poses, twists
from ...motion.curves import twist_shares

STEP = 1.0 / 8.0
"""The part of a segment that slopes are measured over: exact for cubics in time, and finite for vertical handles."""

SLOPES = np.array((18.0, -9.0, 2.0)) / (6.0 * STEP)
"""The slope at 0 of the cubic through 0 and three values that are `STEP` apart."""

MEASURED = np.concatenate((np.arange(1, 4) * STEP, 1.0 - np.arange(3, 0, -1) * STEP))
"""The moments in the time of a segment where it is measured: next to its first key, and next to its second."""

FASTEST = 3.0
"""The largest slope of progress that is corrected: up to here a cubic between two keys does not turn back.
Source: Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980."""

SHORTEST = 0.1
"""The length of a tangent from which on progress is not corrected any further to make up for it."""

SMALL = 0.01
"""The least part that the mean has of the squared speeds that it is made of: where the motion turns back on itself
there is no direction to measure along."""


def progress_slopes(progress: np.ndarray) -> np.ndarray:
    """Return the slopes at both ends (2, S) from the progress at the moments `MEASURED` (S, 6), in unit time."""
    return np.stack((progress[:, :3] @ SLOPES, (1.0 - progress[:, :2:-1]) @ SLOPES))


def native_twists(keys: Poses, measured: Poses) -> np.ndarray:
    """Return Blender's own twists at both ends, shape (2, 6, S), in unit time.

    From the poses at both keys (S, 2) and those of Blender's own in-betweens at the moments `MEASURED` (S, 6).
    """
    ends = np.zeros(6, dtype=int)
    ends[3:] = 1
    result = twists.between(
        keys.positions[:, ends].reshape(-1, 3),
        keys.quaternions[:, ends].reshape(-1, 4),
        measured.positions.reshape(-1, 3),
        measured.quaternions.reshape(-1, 4),
    ).reshape(6, -1, 6)
    return np.stack((result[..., :3] @ SLOPES, -(result[..., :2:-1] @ SLOPES)))


def tangents_and_lacks(
    slopes: np.ndarray, native: np.ndarray, screws: np.ndarray, times: np.ndarray, pairs: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of tangents at both ends of S segments, and what the slopes of progress lack there, (2, S).

    Where no segment meets another these are 1 and 0.

    Parameters
    ----------
    slopes : array, shape (2, S)
        Of progress, as `progress_slopes` has them.
    native : array, shape (2, 6, S)
        As `native_twists` has them.
    screws : array, shape (2, 6, S)
        The twists that lead from key to key in unit time, as they are at both ends: spins turn about axes of their own.
    times : array, shape (S, 2)
        The frames of both keys.
    pairs : tuple of array of int, shape (p,)
        The segments that meet at a key: those before it, and those after it.
    """
    tangents, lacks = np.ones(slopes.shape), np.zeros(slopes.shape)
    durations = times[:, 1] - times[:, 0]
    speeds = screws / np.where(durations > 0.0, durations, np.inf)
    before, after = pairs
    share = twist_shares(durations[before], durations[after])
    parts = share * speeds[1][:, before], (1.0 - share) * speeds[0][:, after]
    mean = parts[0] + parts[1]
    squared = np.maximum(_dot(mean, mean), SMALL * sum(_dot(part, part) for part in parts))
    for side, segments, alone in ((1, before, share == 1.0), (0, after, share == 0.0)):
        length = _ratio(_dot(speeds[side][:, segments], mean), squared)
        speed = _ratio(_dot(native[side][:, segments], mean), durations[segments] * squared)
        slope = speed / np.copysign(np.maximum(np.abs(length), SHORTEST), length)
        tangents[side, segments] = length
        lack = np.clip(slope, -FASTEST, FASTEST) - np.clip(slopes[side, segments], -FASTEST, FASTEST)
        lacks[side, segments] = np.where(alone, 0.0, lack)
    return tangents, lacks


def corrected(progress: np.ndarray, elapsed: np.ndarray, lacks: np.ndarray) -> np.ndarray:
    """Return progress (m,) with the slopes that it lacks (2, m) at either end, at times from 0 to 1 in its segment."""
    left = 1.0 - elapsed
    added = elapsed * left * (left * lacks[0] - elapsed * lacks[1])
    return np.where((elapsed > 0.0) & (left > 0.0), progress + added, progress)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("rs,rs->s", a, b)


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)
