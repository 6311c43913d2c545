"""The best mode of each segment: of several modes, the one that comes closest to a recording from this key to the next.

Which that is can only be said where the recording is known: for reducing keys, not for a stream. The keys are the same
whatever the modes, and a smooth mode looks at the keys around its segment and not at the modes there: so segments can
be chosen for one by one, and any choice is a motion. Where two modes meet, it may turn a corner.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses, check_radius, check_recording, check_tolerance, key_samples
from .measures import shell_error
from .modes import KEYFRAME_MODES, interpolate, mode_named
from .poses import Poses, numbers, of_each

MAX_SAME_ERROR_RATIO = 1e-6
"""Errors that differ by less than this share are the same: those of modes that are one motion do."""

MAX_ROUNDING_RATIO = 1e-12
"""The same for errors compared with how far the motion gets."""


def best_modes(
    times: ArrayLike,
    poses: Poses,
    keys: ArrayLike,
    modes: Iterable[str] = tuple(KEYFRAME_MODES),
    radius: float = 0.1,
    tolerance: float | None = None,
) -> tuple[str, ...]:
    """Return the mode of each segment between keys that comes closest to a recording.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    keys : array-like of int, shape (k,), or of bool, shape (n,)
        The samples that are keys: their numbers, rising, or a mask; at least two. What is before the first and behind
        the last does not count.
    modes : iterable of str
        The names in `MODES` to choose from; all modes for keyframes where none are given. Of equally good ones the
        first is taken, or the neighbour's.
    radius : float
        Of the shell, in the unit of the positions.
    tolerance : float, optional
        The largest shell error at any sample, in the unit of the positions. Modes that pass it are out, unless all do.

    Returns
    -------
    tuple of str, k - 1 modes
        With the least RMS shell error in each segment, as `interpolate_by_segments` takes them.

    Raises
    ------
    TypeError
        Where the recording is no `Poses`.
    ValueError
        For an unknown mode or none, keys that are no rising samples or fewer than two, and samples that are not finite,
        out of order or of no size.

    See Also
    --------
    interpolate_by_segments : The motion that these modes make.
    reduce_keys : Few keys, for one mode.

    Examples
    --------
    A motion that was made of two modes is taken apart again:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, best_modes, interpolate_by_segments
    >>> keys = Poses([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 0, 0, 0], [1, 0, 0, 1], [1, 0, 0, 0]])
    >>> times = np.linspace(0, 2, 21)
    >>> recording = interpolate_by_segments([0, 1, 2], keys, times, ["lerp_slerp", "dq_sclerp"])
    >>> best_modes(times, recording, [0, 10, 20])
    ('lerp_slerp', 'dq_sclerp')
    """
    if isinstance(modes, str):
        raise ValueError(f"modes to choose from need to be several names: of a single one make a list, [{modes!r}]")
    modes = _named(modes, "modes to choose from")
    if not modes:
        raise ValueError("there is no mode to choose from")
    check_radius(radius)
    if tolerance is not None:
        check_tolerance(tolerance)
    times = numbers(times, "times")
    check_recording(times, poses)
    keys = key_samples(keys, len(times))
    samples = slice(keys[0], keys[-1] + 1)
    truth = poses[samples]
    errors = np.stack(
        [shell_error(interpolate(times[keys], poses[keys], times[samples], mode), truth, radius) for mode in modes]
    )
    rounding = MAX_ROUNDING_RATIO * (float(np.abs(truth.positions).max()) + radius)
    allowed = None if tolerance is None else tolerance + rounding
    return tuple(modes[best] for best in least_errors(errors, keys - keys[0], rounding, allowed))


def _named(modes: Iterable[str], what: str) -> tuple[str, ...]:
    """Return names that are all of modes, or an error that says what they are for."""
    if not isinstance(modes, Iterable):
        raise TypeError(f"{what} are {modes!r}: give a list of names")
    modes = tuple(modes)
    for mode in modes:
        mode_named(mode)
    return modes


def least_errors(
    errors: np.ndarray, keys: np.ndarray, rounding: float = 0.0, tolerance: float | None = None
) -> np.ndarray:
    """In each segment, which of several errors has the least root mean square.

    Parameters
    ----------
    errors : array, shape (m, n)
        Of m modes at n samples, from the first key on.
    keys : array of int, shape (k,)
        The samples that are keys, rising from 0.
    rounding : float
        Errors that differ by no more than this are the same, or by a share of `MAX_SAME_ERROR_RATIO`.
    tolerance : float, optional
        The largest error at any sample. What passes it is out, unless everything does.

    Returns
    -------
    array of int, shape (k - 1,)
        Of equally good ones what keeps the number of changes from segment to segment smallest, or else the first.
    """
    starts, inside = keys[:-1], errors[:, : keys[-1]]
    rms = np.sqrt(np.add.reduceat(inside**2, starts, axis=1) / np.diff(keys))
    if tolerance is not None:
        peaks = np.maximum.reduceat(inside, starts, axis=1)
        excluded = peaks > tolerance
        rms[excluded & ~excluded.all(axis=0)] = np.inf
    best = rms.min(axis=0)
    return _fewest_changes(rms <= best * (1.0 + MAX_SAME_ERROR_RATIO) + rounding)


def _fewest_changes(acceptable: np.ndarray) -> np.ndarray:
    """One of the acceptable choices (m, s) for each of s segments, with the fewest changes; of equals the first."""
    sets = np.left_shift(1, np.arange(len(acceptable))) @ acceptable
    # What all segments since the last change have in common, for as long as that is anything.
    shared = np.array(list(accumulate(sets.tolist(), lambda common, current: common & current or current)))
    ends = np.flatnonzero(np.append(shared[:-1] & sets[1:], 0) == 0)
    first = np.argmax(shared[ends, None] >> np.arange(len(acceptable)) & 1, axis=1)
    return np.repeat(first, np.diff(ends, prepend=-1))


def interpolate_by_segments(key_times: ArrayLike, keys: Poses, times: ArrayLike, modes: Sequence[str]) -> Poses:
    """Return the poses at `times` of one object whose segments have modes of their own.

    Parameters
    ----------
    key_times : array-like, shape (k,)
        Strictly rising, in any unit.
    keys : Poses, shape (k,)
        At least two, as in `interpolate`.
    times : array-like, shape (m,)
        In any order, in the unit of `key_times`. Outside of the keys the end poses hold.
    modes : sequence of str, k - 1 of them
        Names in `MODES`.

    Returns
    -------
    Poses, shape (m,)
        With unit quaternions, in the unit of the keys' positions.

    Raises
    ------
    TypeError
        Where the keys are no `Poses`.
    ValueError
        As `interpolate` does, and for another number of modes, or more than one object.

    See Also
    --------
    best_modes : The mode of each segment that comes closest to a recording.
    interpolate : One mode for all segments.

    Examples
    --------
    >>> from rigid_motion.motion import Poses, interpolate_by_segments
    >>> keys = Poses([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 0, 0, 0], [1, 0, 0, 1], [1, 0, 0, 0]])
    >>> shown = interpolate_by_segments([0, 1, 2], keys, [0.5, 1.5], ["lerp_slerp", "dq_sclerp"])
    >>> shown.positions.round(6).tolist()
    [[0.5, 0.0, 0.0], [1.5, 0.207107, 0.0]]
    """
    check_poses(keys, "keys")
    key_times, times = numbers(key_times, "key times"), numbers(times, "times")
    if key_times.ndim != 1 or times.ndim != 1 or len(key_times) < 2:
        raise ValueError("modes for segments need a row of at least two key times, and a row of times")
    if isinstance(modes, str):
        raise ValueError(f"{modes!r} is a single mode: give one for each segment, or use interpolate")
    modes = _named(modes, "modes of segments")
    if len(modes) != len(key_times) - 1:
        raise ValueError(f"{len(modes)} modes do not fit {len(key_times)} keys")
    if keys.shape != key_times.shape:
        raise ValueError(f"key times of shape {key_times.shape} do not fit keys of shape {keys.shape}")
    modes_at_times = np.array(modes)[np.clip(np.searchsorted(key_times, times, side="right") - 1, 0, len(modes) - 1)]
    result = of_each(keys, lambda rows: np.empty((len(times), rows.shape[-1])))
    for mode in dict.fromkeys(modes):
        selected = modes_at_times == mode
        result[selected] = interpolate(key_times, keys, times[selected], mode)
    return result
