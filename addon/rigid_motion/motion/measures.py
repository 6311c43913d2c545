"""Error measures: how far a motion is from the recording that it approximates.

Lengths are in the unit of the positions, rotations in radians, velocities in units per second. The shell error is the
largest displacement of any point of the body within `radius` of its origin. It combines the position and rotation
errors as they show on a body of that size. A tolerance on it holds for all of these points, in any direction.

The name and the reasoning come from the Animation Compression Library (`docs/error_metrics.md` there). That library
measures three points of the shell, which may move by less than half of the shell error (0.41 in 20 000 random pairs).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses, check_radii
from .poses import Poses, numbers
from .quaternions import angle_between, components, cross

ZERO_LENGTH = 1e-150
"""Replaces zero where only ratios count. Its square is still above the smallest float."""

NEWTON_STEPS = 6
"""Steps to full precision: the first guess is within a factor of 1.5, and each step doubles the correct digits."""


@dataclass(frozen=True)
class Errors:
    """The errors of n poses, as returned by `measure`.

    See Also
    --------
    measure : Computes these errors.
    rms : Reduces many errors to one number.

    Examples
    --------
    >>> from rigid_motion.motion import Poses, measure
    >>> here, there = (Poses([[x, 0, 0], [x, 0, 0]], [[1, 0, 0, 0]] * 2) for x in (0, 0.25))
    >>> errors = measure([0, 1], there, here)
    >>> errors.position.tolist(), errors.velocity.tolist()
    ([0.25, 0.25], [0.0])
    """

    shell: np.ndarray
    """The largest displacement of any point of the shell, shape (..., n), in the unit of the positions."""

    position: np.ndarray
    """The distance between the origins, shape (..., n), in the unit of the positions."""

    rotation: np.ndarray
    """The angle between the rotations, shape (..., n), in radians from 0 to pi."""

    velocity: np.ndarray
    """The error of the origin's velocity between samples, shape (..., n - 1), in units per second."""


def measure(times: ArrayLike, poses: Poses, truth: Poses, radius: ArrayLike = 0.1) -> Errors:
    """Return all errors of `poses` against `truth`, sample by sample.

    Parameters
    ----------
    times : array-like, shape (n,) or (..., n)
        Seconds, rising.
    poses, truth : Poses, shape (..., n)
        With unit quaternions, both in the same unit of length.
    radius : float or array-like, shape (..., n)
        The radius of the shell: no point this near the origin is displaced by more than the shell error. In the unit of
        the positions; not below zero.

    Returns
    -------
    Errors
        Lengths in the unit of the positions, angles in radians.

    Raises
    ------
    TypeError
        If either motion is not a `Poses`.
    ValueError
        If the shapes do not fit each other, or the radius is not a length.

    See Also
    --------
    rms : Reduces many errors to one number.
    shell_error : The shell error alone.

    Notes
    -----
    The velocity error compares the velocities of the origin, from differences between successive samples. Uneven
    in-betweens and corners at keys show in it first. A motion that is merely displaced has no velocity error.

    Examples
    --------
    A body that should turn by 90 degrees, but does not:

    >>> from rigid_motion.motion import Poses, measure
    >>> rests = Poses([[0, 0, 0]] * 2, [[1, 0, 0, 0]] * 2)
    >>> turns = Poses([[0, 0, 0]] * 2, [[1, 0, 0, 0], [0.5**0.5, 0, 0, 0.5**0.5]])
    >>> errors = measure([0, 1], rests, turns, radius=0.1)
    >>> errors.shell.round(6).tolist(), errors.rotation.round(6).tolist()
    ([0.0, 0.141421], [0.0, 1.570796])
    """
    radius = check_radii(radius)
    _check_pair(poses, truth)
    times = numbers(times, "times")
    if times.shape not in (poses.shape, truth.shape, poses.shape[-1:]) or not times.shape:
        raise ValueError(f"times of shape {times.shape} do not fit poses of shape {poses.shape}")
    # Poses that are not finite have errors that are not finite, without a warning.
    with np.errstate(over="ignore", invalid="ignore"):
        offset = poses.positions - truth.positions
        return Errors(
            shell=shell_error(poses, truth, radius),
            position=np.linalg.norm(offset, axis=-1),
            rotation=angle_between(truth.quaternions, poses.quaternions),
            velocity=np.linalg.norm(np.diff(offset, axis=-2), axis=-1) / np.diff(times, axis=-1),
        )


def _check_pair(poses: Poses, truth: Poses) -> None:
    """Raise an error if two motions cannot be compared."""
    check_poses(poses, "poses")
    check_poses(truth, "the true poses")
    if poses.shape != truth.shape:
        try:
            np.broadcast_shapes(poses.shape, truth.shape)
        except ValueError:
            raise ValueError(f"poses of shape {poses.shape} do not fit true ones of shape {truth.shape}") from None


def shell_error(poses: Poses, truth: Poses, radius: ArrayLike = 0.1) -> np.ndarray:
    """Return the largest displacement of any point within `radius` of the origin, due to position and rotation.

    Parameters
    ----------
    poses, truth : Poses, shape (..., n)
        With unit quaternions.
    radius : float or array-like, shape (..., n)
        The radius of the ball around the origin, in the unit of the positions, before the body's own scale.

    Returns
    -------
    array, shape (..., n)
        In the unit of the positions.

    Raises
    ------
    TypeError
        If either motion is not a `Poses`.
    ValueError
        If the shapes do not fit each other.

    See Also
    --------
    measure : All errors.

    Notes
    -----
    The name comes from the Animation Compression Library (`docs/error_metrics.md` there), which measures three points.

    From one pose to the other the origin moves by d, and the body turns by theta about the axis n. A point of the shell
    moves by d plus a chord perpendicular to the axis, at most 2 radius sin(theta / 2) long and in any such direction.
    The largest displacement is therefore the length of d_along + d_across (1 + chord / |d_across|). With
    v = n sin(theta / 2), the vector part of the quaternion, its square is d.d + 4 radius |d x v| + 4 radius^2 v.v,
    which needs no division.

    Examples
    --------
    An error of 3 cm, and then of 3 cm and a half turn, which moves some point of the shell 20 cm across:

    >>> from rigid_motion.motion import Poses, shell_error
    >>> truth = Poses([[0, 0, 0]] * 2, [[1, 0, 0, 0]] * 2)
    >>> off = Poses([[0.03, 0, 0]] * 2, [[1, 0, 0, 0], [0, 0, 0, 1]])
    >>> shell_error(off, truth, radius=0.1).round(6).tolist()
    [0.03, 0.23]
    """
    _check_pair(poses, truth)
    radius = numbers(radius, "radii")
    (w, *xyz), (true_w, *true_xyz) = (components(some.quaternions) for some in (poses, truth))
    d, v = components(poses.positions - truth.positions), cross(true_xyz, xyz)
    for axis in range(3):
        v[axis] += true_w * xyz[axis]
        v[axis] -= w * true_xyz[axis]
    if poses.scales is None and truth.scales is None:
        return largest_displacement(d, v, radius)
    one = np.ones(poses.shape)
    scales = [one if scales is None else scales for scales in (poses.scales, truth.scales)]
    return largest_displacement(d, v, *(radius * scale for scale in scales))


def largest_displacement(
    d: np.ndarray, v: np.ndarray, radius: np.ndarray, true_radius: np.ndarray | None = None
) -> np.ndarray:
    """Return the shell error (..., n) of balls displaced by d and turned by v, both (3, ..., n). It may overwrite v.

    v is the vector part of the unit quaternion of the turn. `true_radius` is the correct radius of the balls, if it
    differs from `radius`.
    """
    if true_radius is not None:
        return _displacement_of_growing(d, v, radius, true_radius)
    v *= 2.0 * radius
    squared = _dot(d, d)
    squared += _dot(v, v)
    squared += 2.0 * _length(cross(d, v))
    return np.sqrt(squared, out=squared)


def _displacement_of_growing(d: np.ndarray, v: np.ndarray, radius: np.ndarray, true_radius: np.ndarray) -> np.ndarray:
    """Return the shell error (..., n) of balls with two different radii, from d and v (3, ..., n).

    It is the longest sum of d and a vector to an ellipsoid about the axis. The half-axis along the axis is the
    difference of the radii. The half-axes across are the third side of the triangle that the radii form with theta
    between them. Newton's method finds, from below, how far the Lagrange multiplier is above the square of the larger
    half-axis.

    Source: Conn, Gould and Toint, "Trust-Region Methods", 2000, section 7.3.
    """
    v = np.where(
        _length(v) > ZERO_LENGTH, v, np.array((ZERO_LENGTH, 0.0, 0.0)).reshape(3, *[1] * (v.ndim - 1))
    )  # Any axis will do.
    sine = _length(v)
    axis_along, squared_growth = np.abs(radius - true_radius), (radius - true_radius) ** 2
    squared_chord = 4.0 * radius * true_radius * sine * sine
    axis_across = np.sqrt(squared_growth + squared_chord)
    along, across = np.abs(_dot(d, v)) / sine, _length(cross(d, v)) / sine
    pull_along, pull_across = axis_along * along, axis_across * across
    least = np.maximum(np.maximum(pull_across, pull_along - squared_chord), ZERO_LENGTH)
    above = least
    for _ in range(NEWTON_STEPS):
        share_along, share_across = pull_along / (above + squared_chord), pull_across / above
        squared = share_along**2 + share_across**2
        slope = share_along**2 / (above + squared_chord) + share_across**2 / above
        above = np.maximum(above + squared / np.maximum(slope, ZERO_LENGTH) * (np.sqrt(squared) - 1.0), least)
    share = np.minimum(pull_along / (above + squared_chord), 1.0)
    return np.hypot(along + axis_along * share, across + axis_across * np.sqrt(1.0 - share * share))


def rms(errors: ArrayLike) -> float:
    """Return the root mean square over all samples.

    Parameters
    ----------
    errors : array-like, any shape
        Errors of samples, in any unit.

    Returns
    -------
    float
        In the unit of the errors; 0 if there are none.

    See Also
    --------
    measure : Computes errors, sample by sample.

    Examples
    --------
    >>> from rigid_motion.motion import rms
    >>> rms([3.0, 4.0, 0.0, 0.0])
    2.5
    """
    errors = numbers(errors, "errors")
    return float(np.sqrt(np.mean(np.square(errors)))) if errors.size else 0.0


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the dot products of vectors (3, ...)."""
    return np.einsum("i...,i...->...", a, b)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(_dot(vectors, vectors))
