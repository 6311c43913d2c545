"""The best mode of each segment: of several modes, the one that comes closest to a recording from this key to the next.

Which that is can only be said where the recording is known: for reducing keys, not for a stream. The keys are the same
whatever the modes, and a smooth mode looks at the keys around its segment and not at the modes there: so segments can
be chosen for one by one, and any choice is a motion. Where two modes meet, it may turn a corner.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np

from .measures import shell_error
from .modes import KEYFRAME_MODES, interpolate
from .poses import Poses

ALIKE = 1e-6
"""Errors that differ by less than this share are the same: those of modes that are one motion do."""

ROUNDING = 1e-12
"""The same for errors compared with how far the motion gets."""


def best_modes(
    times: np.ndarray,
    poses: Poses,
    keys: np.ndarray,
    modes: Iterable[str] = KEYFRAME_MODES,
    radius: float = 0.1,
    tolerance: float | None = None,
) -> tuple[str, ...]:
    """The mode of each segment between keys that comes closest to a recording.

    Parameters
    ----------
    times : array, shape (n,)
        Seconds, strictly rising.
    poses : Poses, shape (n,)
        The recording.
    keys : array of int, shape (k,)
        The samples that are keys, rising, at least two. What is before the first and behind the last does not count.
    modes : iterable of str
        Those to choose from, of `MODES`. Of equally good ones the first is taken, or the neighbour's.
    radius : float
        Of the shell, in the unit of the positions.
    tolerance : float, optional
        The largest shell error at any sample. Modes that pass it are out, unless all do.

    Returns
    -------
    tuple of str, k - 1 modes
        With the least RMS shell error in each segment, as `interpolate_by_segments` takes them.

    Raises
    ------
    ValueError
        As `interpolate` does, and without any mode.
    """
    modes = tuple(modes)
    if not modes:
        raise ValueError("there is no mode to choose from")
    samples = slice(keys[0], keys[-1] + 1)
    truth = poses[samples]
    errors = np.stack(
        [shell_error(interpolate(times[keys], poses[keys], times[samples], mode), truth, radius) for mode in modes]
    )
    rounding = ROUNDING * (float(np.abs(truth.positions).max()) + radius)
    allowed = None if tolerance is None else tolerance + rounding
    return tuple(modes[best] for best in least_errors(errors, keys - keys[0], rounding, allowed))


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
        Errors that differ by no more than this are the same, or by a share of `ALIKE`.
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
    return _fewest_changes(rms <= best * (1.0 + ALIKE) + rounding)


def _fewest_changes(acceptable: np.ndarray) -> np.ndarray:
    """One of the acceptable choices (m, s) for each of s segments, with the fewest changes; of equals the first."""
    sets = np.left_shift(1, np.arange(len(acceptable))) @ acceptable
    # What all segments since the last change have in common, for as long as that is anything.
    shared = np.array(list(accumulate(sets.tolist(), lambda common, current: common & current or current)))
    ends = np.flatnonzero(np.append(shared[:-1] & sets[1:], 0) == 0)
    first = np.argmax(shared[ends, None] >> np.arange(len(acceptable)) & 1, axis=1)
    return np.repeat(first, np.diff(ends, prepend=-1))


def interpolate_by_segments(key_times: np.ndarray, keys: Poses, times: np.ndarray, modes: Sequence[str]) -> Poses:
    """The poses at `times` of one object whose segments have modes of their own.

    Parameters
    ----------
    key_times : array, shape (k,)
        Strictly rising.
    keys : Poses, shape (k,)
    times : array, shape (m,)
        In any order. Outside of the keys the end poses hold.
    modes : sequence of str, k - 1 of them
        Of `rigid_motion.motion.MODES`.

    Returns
    -------
    Poses, shape (m,)

    Raises
    ------
    ValueError
        As `interpolate` does, and for another number of modes.
    """
    if len(modes) != len(key_times) - 1:
        raise ValueError(f"{len(modes)} modes do not fit {len(key_times)} keys")
    key_times, times = np.asarray(key_times, dtype=np.float64), np.asarray(times, dtype=np.float64)
    modes_at_times = np.array(modes)[np.clip(np.searchsorted(key_times, times, side="right") - 1, 0, len(modes) - 1)]
    positions, quaternions = np.empty((len(times), 3)), np.empty((len(times), 4))
    scales = None if keys.scales is None else np.empty(len(times))
    for mode in dict.fromkeys(modes):
        selected = modes_at_times == mode
        filled = interpolate(key_times, keys, times[selected], mode)
        positions[selected], quaternions[selected] = filled.positions, filled.quaternions
        if scales is not None:
            scales[selected] = filled.scales
    return Poses(positions, quaternions, scales)
