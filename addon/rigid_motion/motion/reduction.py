"""Key reduction: the few samples of a recording that, as keys of a mode, reproduce its motion.

A key is a pose: all channels together. What is promised of them, and checked; `key_search` finds them.
"""

from __future__ import annotations

from numbers import Integral

import numpy as np

from .key_search import Recording, Search
from .modes import mode_named
from .poses import LIMIT, SHORTEST, Poses
from .quaternions import align_signs


def reduce_keys(
    times: np.ndarray,
    poses: Poses,
    mode: str = "motor_spline",
    tolerance: float | None = None,
    radius: float = 0.1,
    *,
    budget: int | None = None,
    rms: bool = False,
    tries: int = 3,
) -> np.ndarray:
    """The fewest samples that keep the shell error of a mode within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array, shape (n,)
        Seconds, strictly rising.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    mode : str
        One of `MODES`.
    tolerance : float, optional
        The largest shell error anywhere, in the unit of the positions; with `rms` the root mean square over all
        samples.
    radius : float
        Of the shell, in the unit of the positions; not below zero.
    budget : int, optional
        The most keys, at least 2, instead of a tolerance: the error is then as small as can be found.
    rms : bool
        Go by the root mean square of the shell error instead of the largest.
    tries : int
        How many times more keys are taken out than the tolerance allows, and put back where the motion is off: up to
        three, each of which takes about half as long as the first search. Under `rms` it gains a hundredth at most, so
        it is off.

    Returns
    -------
    array of int, shape (k,)
        Rising, the first and the last sample among them.

    Raises
    ------
    ValueError
        Where it is not one of tolerance and budget that is given, or either or the radius is no sensible number, or a
        sample is not finite, out of order or of no size.
    """
    check_wishes(mode, tolerance, budget)
    check_radius(radius)
    times = np.asarray(times, dtype=np.float64)
    check_recording(times, poses)
    if len(times) <= 2:
        return np.arange(len(times))
    poses = Poses(poses.positions, align_signs(poses.quaternions), poses.scales)
    search = Search(Recording(times, poses, mode, radius, tolerance or 1.0), rms=rms)
    return search.within(tries) if tolerance is not None else search.within_budget(budget)


def check_wishes(mode: str, tolerance: float | None, budget: int | None) -> None:
    """A ValueError that says what is wrong with what is asked for."""
    if (tolerance is None) == (budget is None):
        raise ValueError("key reduction needs either a tolerance or a budget of keys")
    mode_named(mode)
    if tolerance is not None and not 1.0 / LIMIT < float(tolerance) < LIMIT:
        raise ValueError(f"a tolerance of {tolerance} is not a positive number from {1.0 / LIMIT:g} to {LIMIT:g}")
    if budget is not None and (isinstance(budget, bool) or not isinstance(budget, Integral)):
        raise ValueError(f"a budget of {budget} is no whole number of keys")
    if budget is not None and budget < 2:
        raise ValueError(f"a budget of {budget} keys is too small: a motion begins and ends with one")


def check_radius(radius: float) -> None:
    """A ValueError where the shell's radius is no length: without turns it is zero."""
    if not 0.0 <= radius < LIMIT:
        raise ValueError(f"a radius of {radius} is not a number from 0 to {LIMIT:g}")


def check_recording(times: np.ndarray, poses: Poses, whose: str = "") -> None:
    """A ValueError that names the first sample (n,) that is wrong."""
    if times.shape != poses.shape:
        raise ValueError(f"{times.size} times do not fit poses of shape {poses.shape}")
    numbers = np.column_stack((times, poses.positions, poses.quaternions))
    finite = (np.abs(numbers) < LIMIT).all(axis=1)
    if not finite.all():
        raise ValueError(f"{whose}sample {int(np.argmin(finite))} is not finite, or has a number beyond {LIMIT:g}")
    if not (turns := poses.quaternions.any(axis=1)).all():
        raise ValueError(f"{whose}sample {int(np.argmin(turns))} has a quaternion of length zero")
    if poses.scales is not None and not (sound := (poses.scales > 1.0 / LIMIT) & (poses.scales < LIMIT)).all():
        raise ValueError(f"{whose}sample {int(np.argmin(sound))} has a scale that is not a positive number")
    if np.any(early := np.diff(times) <= SHORTEST):
        raise ValueError(f"{whose}sample {int(np.argmax(early)) + 1} is not later than the one before it")
