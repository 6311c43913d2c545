"""Extrinsic Euler angles of a motion, continuous over time.

Orders are Blender's: "XYZ" turns about the x axis first, then about y, then about z, all of them fixed. Angles are in
radians about x, y and z, listed like Blender's channels whatever the order of turning.

Source: Bernardes and Viollet, "Quaternion to Euler angles conversion: a direct, general and computationally efficient
method", PLoS ONE 17(11), 2022.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from .trigonometry import fill_sine_and_cosine

ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")

MIN_UNLOCKED_LENGTH = 1e-7
"""Below this length, a half sum or half difference of angles has no direction: gimbal lock."""


def extrinsic_eulers_from_quaternions(quaternions: np.ndarray, order: str, starts: Sequence[int] = (0,)) -> np.ndarray:
    """Return the Euler angles of a motion's rotations, each set of angles as near as possible to the one before.

    Parameters
    ----------
    quaternions : array, shape (n, 4)
        Unit quaternions w, x, y, z, of any sign. Several motions may follow one another.
    order : str
        One of `ORDERS`.
    starts : sequence of int
        Where each motion begins.

    Returns
    -------
    array, shape (n, 3)
        Radians about x, y and z. Angles may leave the range of a full turn, except the first ones of each motion.

    Notes
    -----
    The half sum and the half difference of the outer angles each have the direction of a plane vector of quaternion
    components. In gimbal lock, one of the vectors passes through zero to the other side. Taken as directions of lines,
    with lengths that may be negative, both stay continuous, and so do the angles. Where a vector is zero, its direction
    is free, and is interpolated between its neighbours.
    """
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = (i - j) * (j - k) * (k - i) // 2
    w, *xyz = quaternions.T
    half_sum, outer = _direction(w - xyz[j], xyz[i] + sign * xyz[k], starts)
    half_difference, inner = _direction(w + xyz[j], sign * xyz[k] - xyz[i], starts)
    angles = np.empty((3, len(quaternions)))
    angles[i] = half_sum - half_difference
    angles[j] = _unwrapped(2.0 * np.arctan2(inner, outer), 2.0 * np.pi, starts)[0] - 0.5 * np.pi
    angles[k] = sign * (half_sum + half_difference)
    # The first angles are within half a turn, as an animator would key them.
    turns = np.rint(angles[:, list(starts)] / (2.0 * np.pi))
    angles -= 2.0 * np.pi * turns.repeat(_counts(starts, len(quaternions)), axis=1)
    return angles.T


def quaternions_from_extrinsic_eulers(angles: np.ndarray, order: str) -> np.ndarray:
    """Return the rotations (n, 4) of angles (n, 3) in radians about x, y and z, applied in this order."""
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = (i - j) * (j - k) * (k - i) // 2
    sines, cosines = np.empty((2, 3, len(angles)))
    fill_sine_and_cosine(0.5 * angles.T[[i, j, k]], sines, cosines, narrow=False)
    (si, sj, sk), (ci, cj, ck) = sines, cosines
    quaternions = np.empty((4, len(angles)))
    quaternions[0] = ci * cj * ck + sign * si * sj * sk
    quaternions[1 + i] = si * cj * ck - sign * ci * sj * sk
    quaternions[1 + j] = ci * sj * ck + sign * si * cj * sk
    quaternions[1 + k] = ci * cj * sk - sign * si * sj * ck
    return quaternions.T


def _direction(x: np.ndarray, y: np.ndarray, starts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle of the line through each plane vector, without jumps, and the signed length of the vector."""
    length = np.sqrt(x * x + y * y)
    angle = np.arctan2(y, x)
    free = length < MIN_UNLOCKED_LENGTH
    if not free.any():
        line, turns = _unwrapped(angle, np.pi, starts)
        is_odd = turns != 2.0 * np.floor(0.5 * turns)
        return line, np.negative(length, out=length, where=is_odd)
    line = np.zeros_like(angle)
    for first, last in itertools.pairwise((*starts, len(angle))):
        rows = np.arange(first, last)
        bound = rows[~free[first:last]]
        if len(bound):
            line[first:last] = np.interp(rows, bound, _unwrapped(angle[bound], np.pi, (0,))[0])
    return line, np.where(free, length, length * np.sign(np.cos(line - angle)))


def _unwrapped(angles: np.ndarray, period: float, starts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (n,) that change by half a period at most within each motion, and how many periods were removed."""
    turns = np.rint(np.diff(angles, prepend=angles[:1]) / period)
    turns[list(starts)] = 0.0
    np.cumsum(turns, out=turns)
    if len(starts) > 1:
        turns -= turns[list(starts)].repeat(_counts(starts, len(angles)))
    return angles - period * turns, turns


def _counts(starts: Sequence[int], count: int) -> np.ndarray:
    """Return the length of each motion."""
    return np.diff((*starts, count))
