"""Argument checks: each error names the argument or sample, says what is wrong with it, and how to fix it."""

from __future__ import annotations

import math
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from .poses import MAX_ABS, MIN_TIME_GAP, Poses, numbers

KEYS_WANTED = "give rising numbers of samples, as reduce_keys and decimate return them, or a mask of all samples"


def check_poses(poses: Poses, name: str) -> None:
    """Raise a TypeError if the argument with this name is not `Poses`, but an array, a list or something else."""
    if not isinstance(poses, Poses):
        raise TypeError(f"{name} need to be Poses, not {type(poses).__name__}: Poses(positions, quaternions)")


def check_times(times: np.ndarray, whose: str = "") -> None:
    """Raise a ValueError that names the first of the times (n,) that is not later than the one before it."""
    if times.ndim != 1:
        raise ValueError(f"times of shape {times.shape}: give one row of them, in seconds")
    if not (finite := np.abs(times) < MAX_ABS).all():
        raise ValueError(f"{whose}sample {int(np.argmin(finite))} has a time that is not finite, or beyond {MAX_ABS:g}")
    if np.any(early := np.diff(times) <= MIN_TIME_GAP):
        raise ValueError(f"{whose}sample {int(np.argmax(early)) + 1} is not later than the one before it")


def check_recording(times: np.ndarray, poses: Poses, whose: str = "") -> None:
    """Raise a ValueError that names the first sample (n,) that is wrong."""
    check_poses(poses, "poses")
    if times.shape != poses.shape or times.ndim != 1:
        raise ValueError(f"{times.size} times do not fit poses of shape {poses.shape}: one object has a row of each")
    numbers = np.column_stack((times, poses.positions, poses.quaternions))
    finite = (np.abs(numbers) < MAX_ABS).all(axis=1)
    if not finite.all():
        raise ValueError(f"{whose}sample {int(np.argmin(finite))} is not finite, or has a number beyond {MAX_ABS:g}")
    if not (turns := poses.quaternions.any(axis=1)).all():
        raise ValueError(f"{whose}sample {int(np.argmin(turns))} has a quaternion of length zero")
    if poses.scales is not None and not (sound := (poses.scales > 1.0 / MAX_ABS) & (poses.scales < MAX_ABS)).all():
        raise ValueError(f"{whose}sample {int(np.argmin(sound))} has a scale that is not a positive number")
    check_times(times, whose)


def check_body(times: np.ndarray, poses: Poses, where: str = "") -> None:
    """Raise a ValueError that names the first joint and sample of poses (joints, n) that is wrong."""
    for joint, own in enumerate(poses):
        check_recording(times, own, f"joint {joint}{where}, ")


def key_samples(keys: ArrayLike, samples: int) -> np.ndarray:
    """Return which samples are keys, as rising numbers, shape (k,), with k at least 2.

    Parameters
    ----------
    keys : array-like of int, shape (k,), or of bool, shape (samples,)
        Numbers of samples, or a mask of them.
    samples : int
        The number of samples.

    Raises
    ------
    ValueError
        If keys are anything else. Whole numbers given as floats are refused too: they could be times.
    """
    try:
        given = np.asarray(keys)
    except ValueError:
        raise ValueError(f"keys are rows of different lengths: {KEYS_WANTED}, of one object at a time") from None
    if given.ndim != 1:
        raise ValueError(f"keys have the shape {given.shape}, not (k,): {KEYS_WANTED}")
    if given.dtype == bool:
        if len(given) != samples:
            raise ValueError(f"keys are a mask of {len(given)} samples, and the recording has {samples}")
        given = np.flatnonzero(given)
    if len(given) < 2:
        raise ValueError(f"{len(given)} keys are too few: a motion begins and ends with one")
    if np.issubdtype(given.dtype, np.floating):
        raise ValueError(
            "keys are floats, and could be times: np.searchsorted(times, keys) finds the samples of times, and "
            "np.asarray(keys).astype(int) makes whole numbers of numbers of samples"
        )
    if not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"keys have the type {given.dtype}: {KEYS_WANTED}")
    if (wrong := (given < 0) | (given >= samples)).any():
        key = int(np.argmax(wrong))
        raise ValueError(f"key {key} is sample {given[key]}, and the samples are those from 0 to {samples - 1}")
    numbers = given.astype(np.int64)
    if (falls := np.diff(numbers) <= 0).any():
        key = int(np.argmax(falls)) + 1
        raise ValueError(
            f"the keys are not rising: key {key} is sample {numbers[key]}, after sample {numbers[key - 1]}; "
            "np.unique(keys) puts them in order"
        )
    return numbers


def check_wishes(tolerance: float | None, budget: int | None, tries: int) -> None:
    """Raise a TypeError or ValueError that says what is wrong with the arguments of key reduction."""
    if tolerance is None and budget is None:
        raise ValueError("key reduction needs a tolerance or a budget of keys: give one of the two")
    if tolerance is not None and budget is not None:
        raise ValueError("key reduction goes by a tolerance or by a budget of keys: give one of the two, not both")
    if tolerance is not None:
        check_tolerance(tolerance)
    if budget is not None and whole_number(budget, "budget") < 2:
        raise ValueError(f"a budget of {budget} keys is too small: a motion begins and ends with one")
    if whole_number(tries, "tries") < 0:
        raise ValueError(f"tries is {tries}: give 0 for a single search, or up to 3 for more")


def check_tolerance(tolerance: float) -> None:
    """Raise a TypeError if the tolerance is not a number, a ValueError if it is not a length."""
    if not 1.0 / MAX_ABS < number(tolerance, "tolerance") < MAX_ABS:
        raise ValueError(f"a tolerance of {tolerance} is not a positive number from {1.0 / MAX_ABS:g} to {MAX_ABS:g}")


def check_radius(radius: float) -> None:
    """Raise a TypeError if the radius of the shell is not a number, a ValueError if it is neither a length nor 0."""
    if not (1.0 / MAX_ABS < (given := number(radius, "radius")) < MAX_ABS or given == 0.0):
        raise ValueError(
            f"a radius of {radius} is not a length: give 0, or a number from {1.0 / MAX_ABS:g} to {MAX_ABS:g}"
        )


def check_radii(radii: ArrayLike) -> np.ndarray:
    """Check one radius or an array of them as `check_radius` does, and return them as an array."""
    if not isinstance(radii, np.ndarray | list | tuple):
        check_radius(radii)  # type: ignore[arg-type]  # raises there if it is not a number
    checked = numbers(radii, "radii")
    for radius in np.unique(checked):
        check_radius(radius)
    return checked


def check_flag(flag: bool, name: str) -> None:
    """Raise a TypeError if the argument with this name is neither True nor False."""
    if not isinstance(flag, bool | np.bool_):
        raise TypeError(f"{name} is {flag!r}: give True or False")


def number(value: float, name: str) -> float:
    """Return a number as float, or raise a TypeError with its name if it is not one, such as "5mm" or True."""
    is_one = isinstance(value, Real) and not isinstance(value, bool)
    if not is_one and not (isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf"):
        raise TypeError(f"a {name} of {value!r} is not a number: give a single one, without quotes or unit")
    try:
        return float(value)
    except OverflowError:
        return math.inf


def whole_number(value: int, name: str) -> int:
    """Return a whole number, or raise a TypeError with its name if it is not one, such as 1.5, "80" or True."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}: give a whole number, such as 3")
    return int(value)
