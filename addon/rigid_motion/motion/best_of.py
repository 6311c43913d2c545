"""The best mode for each segment: the one of several that comes closest to the recording from one key to the next.

This needs the recording, so it serves key reduction and not streams. The keys are the same for all modes, and a smooth
mode depends on the keys around its segment but not on the modes there. So each segment can be chosen by itself, and any
choice gives a motion. The motion may turn a corner where two modes meet.
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
"""Errors that differ by less than this fraction count as equal, such as those of two modes that give the same motion.
"""

MAX_ROUNDING_RATIO = 1e-12
"""The same, as a fraction of the largest coordinate plus the radius."""


def best_modes(
    times: ArrayLike,
    poses: Poses,
    keys: ArrayLike,
    modes: Iterable[str] = tuple(KEYFRAME_MODES),
    radius: float = 0.1,
    tolerance: float | None = None,
) -> tuple[str, ...]:
    """Return the mode that comes closest to a recording, for each segment between keys.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    keys : array-like of int, shape (k,), or of bool, shape (n,)
        The samples that are keys: their numbers, rising, or a mask; at least two. Samples before the first key and
        after the last do not count.
    modes : iterable of str
        The names in `MODES` to choose from; by default all modes for keyframes. Of equally good modes, the one of the
        neighbouring segment is taken, or else the first.
    radius : float
        The radius of the shell, in the unit of the positions.
    tolerance : float, optional
        The largest shell error at any sample, in the unit of the positions. Modes that exceed it are excluded, unless
        all do.

    Returns
    -------
    tuple of str, k - 1 modes
        The modes with the least RMS shell error in each segment, in the form that `interpolate_by_segments` takes.

    Raises
    ------
    TypeError
        If the recording is not `Poses`.
    ValueError
        If a mode is unknown or none is given, if keys are not rising samples or fewer than two, or if samples are not
        finite, out of order, or have a zero quaternion or a scale that is not positive.

    See Also
    --------
    interpolate_by_segments : The motion that these modes make.
    reduce_keys : Find few keys, for one mode.

    Examples
    --------
    Recover the two modes that a motion was made with:

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
    modes = _checked_names(modes, "modes to choose from")
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


def _checked_names(modes: Iterable[str], what: str) -> tuple[str, ...]:
    """Return the names as a tuple, or raise an error that says what they are for if one is not a mode."""
    if not isinstance(modes, Iterable):
        raise TypeError(f"{what} are {modes!r}: give a list of names")
    modes = tuple(modes)
    for mode in modes:
        mode_named(mode)
    return modes


def least_errors(
    errors: np.ndarray, keys: np.ndarray, rounding: float = 0.0, tolerance: float | None = None
) -> np.ndarray:
    """Return which of several errors has the least root mean square, for each segment.

    Parameters
    ----------
    errors : array, shape (m, n)
        Errors of m modes at n samples, from the first key on.
    keys : array of int, shape (k,)
        The samples that are keys, rising from 0.
    rounding : float
        Errors count as equal if they differ by no more than this, plus the fraction `MAX_SAME_ERROR_RATIO`.
    tolerance : float, optional
        The largest error at any sample. Modes that exceed it are excluded, unless all do.

    Returns
    -------
    array of int, shape (k - 1,)
        Of equally good modes, those with the fewest changes from segment to segment, or else the first.
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
    """Return one acceptable choice (m, s) for each of s segments, with the fewest changes; the first if equal."""
    sets = np.left_shift(1, np.arange(len(acceptable))) @ acceptable
    # The choices that all segments since the last change have in common, as long as there are any.
    shared = np.array(list(accumulate(sets.tolist(), lambda common, current: common & current or current)))
    ends = np.flatnonzero(np.append(shared[:-1] & sets[1:], 0) == 0)
    first = np.argmax(shared[ends, None] >> np.arange(len(acceptable)) & 1, axis=1)
    return np.repeat(first, np.diff(ends, prepend=-1))


def interpolate_by_segments(key_times: ArrayLike, keys: Poses, times: ArrayLike, modes: Sequence[str]) -> Poses:
    """Return the poses at `times` of one object, with a separate mode for each segment.

    Parameters
    ----------
    key_times : array-like, shape (k,)
        Strictly rising, in any unit.
    keys : Poses, shape (k,)
        At least two, as in `interpolate`.
    times : array-like, shape (m,)
        In any order, in the unit of `key_times`. Outside the keys, the end poses are held.
    modes : sequence of str, k - 1 of them
        Names in `MODES`.

    Returns
    -------
    Poses, shape (m,)
        With unit quaternions, in the unit of the keys' positions.

    Raises
    ------
    TypeError
        If the keys are not `Poses`.
    ValueError
        In the cases of `interpolate`, and if the number of modes is wrong or there is more than one object.

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
    modes = _checked_names(modes, "modes of segments")
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
