"""How a smooth motion with handles passes its keys: how long its path's tangents are, and how fast it runs there.

The direction of the tangent at a key is that of the mode, a mean of the twists before and after it. How far the motion
has come in a segment is what the channels say, as in the other modes: their progress along the segment's chord. The
chords on both sides of a key differ in length and direction. So the tangent is made as long on either side as the
chord is along the mean of both, which makes the speed the same where handles are smooth and the path is straight; what
is lacking on a bent path is added to the progress. With two keys, and where nothing eases, nothing changes.

Arrays have the ten components of location, rotation and scale as rows, segments along the last axis.
"""

from __future__ import annotations

import numpy as np

from ...motion.curves import _shares as twist_shares
from .components import ROTATION, ROWS

STEP = 1.0 / 16.0
"""What part of a segment slopes are measured over: exact for cubics in time, and finite for vertical handles."""

SLOPES = np.array((-11.0, 18.0, -9.0, 2.0)) / (6.0 * STEP)
"""The slope of the cubic through four values that are `STEP` apart, at the first of them."""

MEASURED = np.concatenate((np.arange(1, 4) * STEP, 1.0 - np.arange(3, 0, -1) * STEP))
"""The progress in time of the samples that slopes are measured from."""

FASTEST = 3.0
"""The largest slope of progress that is corrected: up to here a cubic between two keys does not turn back.
Source: Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980."""

SHORTEST = 0.1
"""The length of a tangent from which on progress is not corrected any further to make up for it."""

SMALL = 0.01
"""What part of the squared speeds that it is made of the mean has at least: where the motion turns back on itself there
is no direction to measure along."""


def end_slopes(start: np.ndarray, end: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return the slopes of the channels at both ends of S segments, for segments of duration 1, shape (2, rows, S).

    `measured` (rows, S, 6) are their values at the moments `MEASURED`, start and end (rows, S) those at the keys.
    """
    first = np.concatenate((start[..., None], measured[..., :3]), axis=-1)
    last = np.concatenate((end[..., None], measured[..., :2:-1]), axis=-1)
    return np.stack((first @ SLOPES, -(last @ SLOPES)))


def tangents_and_lacks(
    slopes: np.ndarray, chord: np.ndarray, times: np.ndarray, pairs: tuple[np.ndarray, np.ndarray], by_quaternion: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of tangents at both ends of S segments, and what the slopes of progress lack there, (2, S).

    Where no segment meets another these are 1 and 0.

    Parameters
    ----------
    slopes : array, shape (2, rows, S)
        As `end_slopes` has them.
    chord : array, shape (rows, S)
        From the first key of each segment to the second.
    times : array, shape (S, 2)
        The frames of both keys.
    pairs : tuple of array of int, shape (p,)
        The segments that meet at a key: those before it, and those after it.
    by_quaternion : bool
        Whether rotation is by quaternions, which move by half of the angle.
    """
    weights = np.ones(len(chord))
    if by_quaternion:
        weights[ROWS[ROTATION]] = 4.0

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.einsum("r,rs,rs->s", weights, a, b)

    tangents, lacks = np.ones((2, chord.shape[1])), np.zeros((2, chord.shape[1]))
    before, after = pairs
    durations = times[:, 1] - times[:, 0]
    speeds = chord / np.where(durations > 0.0, durations, np.inf)
    share = twist_shares(durations[before], durations[after])
    parts = share * speeds[:, before], (1.0 - share) * speeds[:, after]
    mean = parts[0] + parts[1]
    squared = np.maximum(dot(mean, mean), SMALL * sum(dot(part, part) for part in parts))
    for side, segments in ((1, before), (0, after)):
        length = _ratio(dot(speeds[:, segments], mean), squared)
        slope = slopes[side][:, segments]
        speed = _ratio(dot(slope, mean), durations[segments] * squared)
        progress = _ratio(dot(slope, chord[:, segments]), dot(chord, chord)[segments])
        tangents[side, segments] = length
        wanted = speed / np.copysign(np.maximum(np.abs(length), SHORTEST), length)
        lacks[side, segments] = np.clip(wanted, -FASTEST, FASTEST) - np.clip(progress, -FASTEST, FASTEST)
    return tangents, lacks


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)


def corrected(progress: np.ndarray, elapsed: np.ndarray, lacks: np.ndarray) -> np.ndarray:
    """Return progress (m,) with the slopes that it lacks (2, m) at either end, at times from 0 to 1 in its segment."""
    left = 1.0 - elapsed
    added = elapsed * left * (left * lacks[0] - elapsed * lacks[1])
    return np.where((elapsed > 0.0) & (left > 0.0), progress + added, progress)
