"""Channel values: convert the poses of a body to quaternions, Euler angles, or an angle about an axis.

Many channel values give the same rotation. In a segment, values are continuous and start with those of its first key.
They do not depend on which moments are sampled: values are tracked from that key in fixed steps of their own.

All arrays hold m samples in S segments, one segment after the other, with rising progress in each.
"""

from __future__ import annotations

import numpy as np

from ...motion import Poses
from ...motion.eulers import extrinsic_eulers_from_quaternions
from ...motion.quaternions import align_signs, conjugate, multiply
from .components import AXIS_ANGLE, LOCATION, REST_COMPONENTS, ROTATION, ROWS, SCALE
from .marks import FULL_TURN

TURN_STEPS = 12
"""The number of steps in which a rotation is tracked from key to key, plus as many for each whole turn."""

MOST_STEPS = 4096
"""The largest number of steps to either side of a segment's first key: a body may turn far beyond its keys."""

NO_TURN = 1e-9
"""The sine of half an angle below which a rotation has no axis."""

MIN_LENGTH_RATIO = 0.5
"""Outside the keys, a length that changes never falls below this fraction of the shorter key."""


def steps_of(
    counts: np.ndarray, progress: np.ndarray, turns: np.ndarray, order: str | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps in which rotations are tracked: their number in each segment (S,), and their progress.

    Segments without samples have no steps. All others have one at progress 0.
    """
    used = counts > 0
    if order is None:
        # The quaternions of the modes are continuous.
        return used.astype(int), np.zeros(np.count_nonzero(used))
    starts = np.concatenate(((0,), np.cumsum(counts[used])[:-1]))
    density = TURN_STEPS * (1.0 + np.abs(turns[used]))
    low, high = np.minimum.reduceat(progress, starts), np.maximum.reduceat(progress, starts)
    before = np.minimum(np.ceil(density * np.maximum(-low, 0.0)), MOST_STEPS)
    behind = np.minimum(np.ceil(density * np.maximum(high, 1.0)), MOST_STEPS)
    many = (before + behind).astype(int) + 1
    number = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many + before, many)
    result = np.zeros(len(counts), dtype=int)
    result[used] = many
    return result, number / density.repeat(many)


def channel_values(
    poses: Poses,
    counts: np.ndarray,
    progress: np.ndarray,
    ends: np.ndarray,
    original: np.ndarray,
    order: str | None,
    is_step: np.ndarray | None = None,
) -> np.ndarray:
    """Return the channel values that give these poses, shape (10, m).

    Parameters
    ----------
    poses : Poses, shape (m,)
        Positions are along the axes that location runs along.
    counts : array of int, shape (S,)
    progress : array, shape (m,)
        0 at the key, which each segment with samples must have at least once.
    ends : array, shape (2, 10, S)
        The channels at both keys of each segment.
    original : array, shape (10, S)
        The objects' own delta transforms.
    order : str or None
    is_step : array of bool, shape (m,), optional
        Which samples are those of `steps_of`; all of them if not given.
    """
    rows = np.zeros((10, len(progress)))
    rows[ROWS[LOCATION]] = poses.positions.T - original[ROWS[LOCATION]].repeat(counts, axis=1)
    if poses.scales is not None:
        rows[ROWS[SCALE]] = poses.scales
    used = np.flatnonzero(counts)
    many = counts[used]
    starts = np.cumsum(many) - many
    keys = np.flatnonzero(progress == 0.0)
    keys = keys[np.searchsorted(keys, starts)]
    turns = multiply(conjugate(original[ROWS[ROTATION]].T).repeat(counts, axis=0), poses.quaternions)
    first, last = ends[:, ROWS[ROTATION]][..., used]
    rotation = rows[ROWS[ROTATION]]
    steps = np.arange(len(progress)) if is_step is None else np.flatnonzero(is_step)
    if order is None:
        signs = np.where(np.einsum("sk,ks->s", turns[keys], first) < 0.0, -1.0, 1.0)
        rotation[:] = turns.T * (signs.repeat(many) * _lengths(first, last, many, progress))
    elif order == AXIS_ANGLE:
        rotation[:] = _axis_angles(turns, many, starts, keys, first, steps)
        rotation[1:] *= _lengths(first[1:], last[1:], many, progress)
    else:
        angles = _eulers(turns, many, starts, steps, order)
        # Both triples of angles for the same rotation, with whole turns.
        offsets = [_whole_turns(first[:3] - both[:, keys]) for both in (angles, other_angles(angles, order))]
        others = other_angles(angles, order)
        misses = [
            np.abs(first[:3] - both[:, keys] - offset).sum(axis=0)
            for both, offset in zip((angles, others), offsets, strict=True)
        ]
        is_other = misses[1] < misses[0]
        offset = np.where(is_other, offsets[1], offsets[0])
        rotation[:3] = np.where(is_other.repeat(many), others, angles) + offset.repeat(many, axis=1)
    return rows


def _preceding_steps(many: np.ndarray, starts: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the index of the step at or before each sample; before the first step of a segment, that step."""
    passed = np.searchsorted(steps, np.arange(many.sum()), side="right") - 1
    return np.maximum(passed, np.searchsorted(steps, starts).repeat(many))


def _eulers(turns: np.ndarray, many: np.ndarray, starts: np.ndarray, steps: np.ndarray, order: str) -> np.ndarray:
    """Return Euler angles (3, m) of unit quaternions (m, 4): for each, the triple nearest to the step before it.

    So angles do not depend on the other samples, even near gimbal lock, where they are fast.
    """
    angles = extrinsic_eulers_from_quaternions(turns, order, starts.tolist()).T
    if len(steps) == len(turns):
        return angles
    of_steps = extrinsic_eulers_from_quaternions(turns[steps], order, np.searchsorted(steps, starts).tolist()).T
    near = of_steps[:, _preceding_steps(many, starts, steps)]
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = (i - j) * (j - k) * (k - i) // 2
    # Triples for the same rotation differ by half turns in half the sum and half the difference of the outer angles.
    outer, outer_near = sign * angles[k], sign * near[k]
    by_sum = np.rint((outer_near + near[i] - outer - angles[i]) / FULL_TURN)
    by_difference = np.rint((outer_near - near[i] - outer + angles[i]) / FULL_TURN)
    angles = np.where((by_sum + by_difference) % 2 == 1, other_angles(angles, order), angles)
    angles += _whole_turns(near - angles)
    # At gimbal lock, as at a key, some angles are free: those of the steps do not depend on other samples.
    angles[:, steps] = of_steps
    return angles


def other_angles(angles: np.ndarray, order: str) -> np.ndarray:
    """Return the other Euler angles (3, ...) of the same rotation: outer ones plus pi, pi minus the middle one."""
    others = angles + np.pi
    middle = "XYZ".index(order[1])
    others[middle] = np.pi - angles[middle]
    return others


def _whole_turns(angles: np.ndarray) -> np.ndarray:
    return FULL_TURN * np.rint(angles / FULL_TURN)


def _lengths(first: np.ndarray, last: np.ndarray, many: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """Return lengths (m,) that change linearly between those of vectors (., s); zero vectors count as length 1."""
    begin, end = (np.sqrt(np.einsum("ks,ks->s", key, key)) for key in (first, last))
    begin, end = (np.where(length > 0.0, length, 1.0) for length in (begin, end))
    least = (MIN_LENGTH_RATIO * np.minimum(begin, end)).repeat(many)
    return np.maximum(begin.repeat(many) + progress * (end - begin).repeat(many), least)


def _axis_angles(
    turns: np.ndarray, many: np.ndarray, starts: np.ndarray, keys: np.ndarray, first: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """Return angles and unit axes (4, m) of unit quaternions (m, 4), continuing those at keys (4, s).

    While a body hardly turns, its axis may swing round between two samples. So the sign of each axis follows the step
    before it, independent of the other samples.
    """
    w, vectors = turns[:, 0], turns[:, 1:].T
    sines = np.sqrt(np.einsum("km,km->m", vectors, vectors))
    is_free = sines < NO_TURN
    axes = vectors / np.where(is_free, 1.0, sines)
    if is_free.any():
        # A sample without rotation takes the axis of its neighbour, which is better than an arbitrary one.
        every = np.arange(len(w))
        at = np.maximum.accumulate(np.where(is_free, -1, every))
        behind = np.minimum.accumulate(np.where(is_free, len(w), every)[::-1])[::-1]
        floor, top = starts.repeat(many), (starts + many).repeat(many)
        near = np.where(at >= floor, at, np.where(behind < top, behind, -1))
        keyed = first[1:] / np.maximum(np.sqrt(np.einsum("ks,ks->s", first[1:], first[1:])), NO_TURN)
        axes = np.where(near >= 0, axes[:, near], keyed.repeat(many, axis=1))
    before, owners = _preceding_steps(many, starts, steps), np.arange(len(many)).repeat(many)[steps]
    flips = np.einsum("km,km->m", axes[:, steps[1:]], axes[:, steps[:-1]]) < 0.0
    passed = np.concatenate(((0,), np.cumsum(flips & (owners[1:] == owners[:-1]))))
    is_against = np.einsum("km,km->m", axes, axes[:, steps[before]]) < 0.0
    signs = np.where((passed[before] + is_against) % 2 == 1, -1.0, 1.0)
    signs *= np.where(np.einsum("ks,ks->s", axes[:, keys] * signs[keys], first[1:]) < 0.0, -1.0, 1.0).repeat(many)
    axes, angles = axes * signs, 2.0 * np.arctan2(np.einsum("km,km->m", axes * signs, vectors), w)
    steps = np.rint(np.diff(angles, prepend=angles[:1]) / FULL_TURN)
    steps[starts] = 0.0
    steps = np.cumsum(steps)
    angles -= FULL_TURN * (steps - steps[starts].repeat(many))
    angles += _whole_turns(first[0] - angles[keys]).repeat(many)
    return np.concatenate((angles[None], axes))


def rotation_values(quaternions: np.ndarray, first: np.ndarray, order: str | None) -> np.ndarray:
    """Return rotations (m, 4) as the rows of channels (4, m), starting as near to `first` (4,) as possible.

    The order is None for quaternions (lengths and the first sign are kept), AXIS_ANGLE, or an order of
    Euler angles in the first three rows.
    """
    if order is None:
        return align_signs(quaternions).T
    count = len(quaternions)
    ends = np.concatenate((REST_COMPONENTS[:3], first, REST_COMPONENTS[7:]))[None, :, None].repeat(2, axis=0)
    poses, progress = Poses(np.zeros((count, 3)), align_signs(quaternions)), np.arange(count) / count
    return channel_values(poses, np.array([count]), progress, ends, REST_COMPONENTS[:, None], order)[ROWS[ROTATION]]
