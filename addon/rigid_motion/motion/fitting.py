"""Key fitting: moves keys by least squares to poses from which the motion between them follows the recording best.

A key that is a recorded pose has the noise of that sample, and the in-betweens on both sides pass through it at any
cost. A fitted key is where the error of the samples around it is smallest. Its time stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import twists
from .checks import check_radius, check_recording, key_samples
from .modes import MODES, interpolate, mode_named
from .poses import Poses, aligned, numbers
from .quaternions import conjugate, multiply, normalise, rotate

DIFFERENCE_STEP_RAD = 1e-5
"""Step of the finite differences that approximate derivatives, in radians and as a fraction of the radius."""

KEY_SWEEPS = 4
"""How often each key is moved. The third time gains a hundredth."""

NORMAL_DAMPING_RATIO = 1e-9
"""Damping of the normal equations, as a fraction of them: a key may have no samples of its own."""


def fit_keys(times: ArrayLike, poses: Poses, keys: ArrayLike, mode: str = "motor_spline", radius: float = 0.1) -> Poses:
    """Return poses for keys at the times of some samples, with in-betweens as close as possible to the recording.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    keys : array-like of int, shape (k,), or of bool, shape (n,)
        The samples at whose times the keys are: their numbers, rising, or a mask; at least two.
    mode : str
        A name in `MODES`.
    radius : float
        The radius of the shell, in the unit of the positions, above zero. It weights rotations against displacements.

    Returns
    -------
    Poses, shape (k,)
        Let d be the displacement of the origin at a sample and theta the angle by which the body is off. The sum of
        squares of d and of the chord 2 radius sin(theta / 2), over all samples, is no larger than with the samples
        themselves as keys. That is the square of the shell error, except for what d and the chord have in common.
        Scales stay as they are.

    Raises
    ------
    TypeError
        If the recording is not `Poses`.
    ValueError
        If the mode is unknown, the radius is not above zero, keys are not rising samples or fewer than two, or samples
        are not finite, out of order, or have a zero quaternion or a scale that is not positive.

    See Also
    --------
    reduce_keys : Finds which samples should be keys.
    interpolate : Returns the motion between keys.

    Notes
    -----
    The Gauss-Newton method (Nocedal and Wright, "Numerical Optimization", 2006, section 10.3) moves several keys at a
    time: keys so far from one another that no segment depends on two of them, and then their neighbours. A key is moved
    only if that lowers the error.

    Examples
    --------
    A body rests, but the second of the three keys was recorded 0.3 off:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, fit_keys
    >>> positions = np.zeros((21, 3))
    >>> positions[10, 0] = 0.3
    >>> keys = fit_keys(np.arange(21), Poses(positions, [[1, 0, 0, 0]] * 21), [0, 10, 20], "lerp_slerp")
    >>> keys.positions[:, 0].round(2).tolist()
    [-0.03, 0.06, -0.03]
    """
    result = mode_named(mode)
    check_radius(radius)
    if radius == 0.0:
        raise ValueError(f"a radius of {radius} is not above zero: turns would not count")
    times = numbers(times, "times")
    check_recording(times, poses)
    keys = key_samples(keys, len(times))
    fitting = _Fitting(times, aligned(poses), keys, mode, radius)
    apart = result.behind + result.ahead + 2
    for _ in range(KEY_SWEEPS):
        for first in range(min(apart, len(keys))):
            fitting.improve(np.arange(first, len(keys), apart))
    return fitting.fitted


class _Fitting:
    """The current keys, and the errors of the motion between them."""

    def __init__(self, times: np.ndarray, poses: Poses, keys: np.ndarray, mode: str, radius: float) -> None:
        self.times, self.key_times, self.mode, self.radius = times, times[keys], mode, radius
        self.first_samples = np.append(0, keys[1:-1])
        """The first sample of each segment."""
        self.truth = poses
        self.fitted = poses[keys]
        self.residuals = self.displacements(self.fitted)

    def displacements(self, keys: Poses) -> np.ndarray:
        """Return displacements of the origin, and chords of the shell along the axis of turning, at all samples: (6,
        n).
        """
        shown = interpolate(self.key_times, keys, self.times, self.mode)
        turn = multiply(shown.quaternions, conjugate(self.truth.quaternions)).T
        chords = 2.0 * self.radius * np.where(turn[0] < 0.0, -turn[1:], turn[1:])
        if shown.scales is not None:
            chords *= np.sqrt(shown.scales * self.truth.scales)
        return np.concatenate(((shown.positions - self.truth.positions).T, chords))

    def improve(self, chosen: np.ndarray) -> None:
        """Move some keys (c,), of which no segment depends on two."""
        slopes = np.empty((6, *self.residuals.shape))
        units = np.repeat((1.0, self.radius), 3)
        for component in range(6):
            step = np.zeros((6, len(chosen)))
            step[component] = DIFFERENCE_STEP_RAD * units[component]
            slopes[component] = (
                self.displacements(_moved(self.fitted, chosen, step)) - self.residuals
            ) / DIFFERENCE_STEP_RAD
        normal_matrix = self.sums(np.einsum("apn,bpn->abn", slopes, slopes), chosen).transpose(2, 0, 1)
        gradient = self.sums(np.einsum("apn,pn->an", slopes, self.residuals), chosen).T
        normal_matrix += (
            np.eye(6)
            * (NORMAL_DAMPING_RATIO * np.trace(normal_matrix, axis1=1, axis2=2) + np.finfo(float).tiny)[:, None, None]
        )
        steps = -np.linalg.solve(normal_matrix, gradient[..., None])[..., 0].T * units[:, None]
        moved = _moved(self.fitted, chosen, steps)
        residuals = self.displacements(moved)
        worse = self.sums((residuals**2).sum(axis=0) - (self.residuals**2).sum(axis=0), chosen) >= 0.0
        if worse.any():
            moved = _moved(self.fitted, chosen, np.where(worse, 0.0, steps))
            residuals = self.displacements(moved)
        self.fitted, self.residuals = moved, residuals

    def sums(self, values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Return sums of values (..., n) over the segments that each chosen key influences, shape (..., c)."""
        of_segments = np.add.reduceat(values, self.first_samples, axis=-1)
        mode, last = MODES[self.mode], of_segments.shape[-1]
        begins = np.maximum(chosen - 1 - mode.ahead, 0)
        ends = np.minimum(chosen + mode.behind + 1, last)
        padded = np.concatenate((of_segments, np.zeros((*values.shape[:-1], 1))), axis=-1)
        return np.add.reduceat(padded, np.stack((begins, ends), axis=1).ravel(), axis=-1)[..., ::2]


def _moved(keys: Poses, chosen: np.ndarray, steps: np.ndarray) -> Poses:
    """Return the keys with the chosen ones (c,) moved by twists (6, c) along their own axes."""
    turns, advances = twists.exponential(steps)
    moved = keys.copy()
    moved.positions[chosen] += rotate(keys.quaternions[chosen], advances.T)
    moved.quaternions[chosen] = normalise(multiply(keys.quaternions[chosen], turns.T))
    return moved
