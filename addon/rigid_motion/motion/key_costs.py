"""Costs of leaving out the samples between keys: errors of a recording, segment by segment.

The search for keys comes back to the same segments again and again. Each segment is worked out once and cached by the
keys that influence it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .key_memory import Memory
from .key_splines import SplineErrors
from .measures import shell_error
from .modes import MODES
from .piecewise import blocks
from .poses import Poses, packed, reshaped, step_repeated
from .segments import prepare_within

MAX_ERROR = 1e30
"""Errors are clipped to this, so that their powers stay finite."""

BATCH_POSES = 2**14
"""Poses processed at a time: few enough for the processor's caches."""

LOOKED_UP = 2**16
"""Segments looked up at a time."""

MAX_REMEMBERED_SEGMENTS = 2**18
"""Segments in the cache at most, so that long recordings do not fill the memory."""

REMEMBERED_EACH = 16
"""Segments in the cache per sample of a shorter recording."""

Found = tuple[np.ndarray, np.ndarray]
"""Costs and peaks of segments."""


class SampleTracks:
    """Tracks of samples to search keys for, one after the other; each track gets its own keys.

    Parameters
    ----------
    times : array, shape (n,)
        Rising within each track.
    poses : Poses, shape (..., n)
        At these times. Poses along leading axes share the same keys.
    mode : str
        The mode that interpolates between keys.
    radius, tolerance : float or array, shape (n,)
        Radius and tolerance of the shell error. Errors are counted in tolerances.
    starts : array of int, optional
        The first sample of each track; by default there is one track.
    off_at_keys : bool
        Whether errors at keys count too, except at the last of a track: other things that move may be off there.
    """

    def __init__(
        self,
        times: np.ndarray,
        poses: Poses,
        mode: str,
        radius: float | np.ndarray,
        tolerance: float | np.ndarray = 1.0,
        starts: np.ndarray | None = None,
        off_at_keys: bool = False,
    ) -> None:
        self.times, self.poses, self.mode = times, poses, mode
        self.radius, self.tolerance, self.off_at_keys = np.asarray(radius), np.asarray(tolerance), off_at_keys
        self.starts = np.zeros(1, dtype=np.int64) if starts is None else starts
        self.ends = np.append(self.starts[1:], len(times)) - 1
        self.truth = packed(poses)
        self.poses_each = float(math.prod(poses.shape[:-1]))
        """How many poses the error of a sample needs, on average."""

    def errors(self, samples: np.ndarray, shown: Poses) -> np.ndarray:
        """Return the errors of poses (..., m) at some samples (m,), in tolerances, shape (m,)."""
        return self.in_tolerances(shell_error(shown, self.truth[samples], _at(self.radius, samples)), samples)

    def in_tolerances(self, errors: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Return errors (m,) at some samples (m,) as multiples of the tolerance there."""
        return errors / _at(self.tolerance, samples)


class Costs:
    """Costs and peaks of the segments of a recording.

    Parameters
    ----------
    recording : SampleTracks
    power : int
        A power of two. The cost is the sum of this power of the errors at the samples between two keys, the peak is the
        largest of these errors.
    """

    def __init__(self, recording: SampleTracks, power: int) -> None:
        self.recording, self.power = recording, power
        mode = MODES[recording.mode]
        self.reach = max(mode.behind, mode.ahead)
        """How many segments a key influences on either side, beyond the two next to it."""
        self.keys = 2 + 2 * self.reach
        """How many keys influence a segment. A segment is a row of these keys: samples, -1 where there is none."""
        self._first = 0 if recording.off_at_keys else 1
        is_plain = type(recording) is SampleTracks and not recording.off_at_keys
        is_plain &= recording.poses.scales is None and len(recording.poses.shape) == 1
        self._spline = SplineErrors(recording) if is_plain and recording.mode == "motor_spline" else None
        self._memory = Memory(min(MAX_REMEMBERED_SEGMENTS, REMEMBERED_EACH * len(recording.times)), 2)

    def of(self, segments: np.ndarray) -> Found:
        """Return costs and peaks (...) of segments (..., keys), zero where no sample counts."""
        rows = segments.reshape(-1, self.keys)
        filled = np.flatnonzero(self._counts(rows) > 0)
        result = np.zeros((len(rows), 2))
        for first in range(0, len(filled), LOOKED_UP):
            some = filled[first : first + LOOKED_UP]
            result[some] = self._memory.find(rows[some], len(self.recording.times), self._work_out)
        return result[:, 0].reshape(segments.shape[:-1]), result[:, 1].reshape(segments.shape[:-1])

    def total(self, keys: np.ndarray) -> float:
        """Return the cost of all segments between keys (k,) of a recording of one track."""
        return float(self.of_keys(keys)[0].sum())

    def peak(self, keys: np.ndarray) -> float:
        """Return the largest error between keys (k,) of a recording of one track."""
        return float(self.of_keys(keys)[1].max())

    def of_keys(self, keys: np.ndarray) -> Found:
        """Return costs and peaks (k - 1,) of the segments between keys (k,) of a recording of one track."""
        ended = np.pad(keys, self.reach, constant_values=-1)
        return self.of(np.lib.stride_tricks.sliding_window_view(ended, self.keys))

    def effort(self, segments: np.ndarray) -> float:
        """Return how many poses segments (..., keys) need at most."""
        return self.recording.poses_each * self._counts(segments.reshape(-1, self.keys)).sum()

    def errors(self, segments: np.ndarray) -> np.ndarray:
        """Return errors at all samples between the keys of segments (s, keys), in tolerances, zero elsewhere: (n,)."""
        errors = np.zeros(len(self.recording.times))
        filled = segments[self._counts(segments) > 0]
        for batch, counts in self._batches(filled) if len(filled) else ():
            samples, errors_there = self._errors(batch, counts)
            errors[samples] = errors_there
        return errors

    def _work_out(self, rows: np.ndarray) -> np.ndarray:
        """Return costs and peaks, shape (s, 2), of segments (s, keys) with samples in them."""
        out, done = np.empty((len(rows), 2)), 0
        for batch, counts in self._batches(rows):
            _, errors = self._errors(batch, counts)
            result, begins = out[done : done + len(batch)], np.cumsum(counts) - counts
            result[:, 1] = np.maximum.reduceat(errors, begins)
            # Squaring is quicker than a power.
            for _ in range(self.power.bit_length() - 1):
                errors = errors * errors
            result[:, 0] = np.add.reduceat(errors, begins)
            done += len(batch)
        return out

    def _batches(self, rows: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield segments (s, keys) in batches, with the number of samples in each, (s,)."""
        counts = self._counts(rows)
        bounds = math.prod(self.recording.poses.shape[:-1]) * np.append(0, np.cumsum(counts))
        for some, _ in blocks(bounds, BATCH_POSES):
            yield rows[some], counts[some]

    def _counts(self, rows: np.ndarray) -> np.ndarray:
        """Return how many samples count in each segment (s, keys), zero if it lacks a key: (s,)."""
        first, second = rows[:, self.reach], rows[:, self.reach + 1]
        return np.where((first >= 0) & (second >= 0), second - first - self._first, 0)

    def _errors(self, rows: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return samples (n,) and their errors (n,) in segments (s, keys), given the number of samples in each (s,)."""
        recording, before = self.recording, self.reach
        if self._spline is not None:
            samples, errors = self._spline.errors(rows, counts)
            return samples, np.minimum(errors, MAX_ERROR)
        begins = rows[:, before] + self._first - np.cumsum(counts) + counts
        samples = np.repeat(begins, counts) + np.arange(counts.sum())
        key_times, keys = _with_ends(recording, rows, self.reach)
        starts, rates = key_times[:, before], 1.0 / (key_times[:, before + 1] - key_times[:, before])
        progress = (recording.times[samples] - np.repeat(starts, counts)) * np.repeat(rates, counts)
        together = keys.shape[:-2]
        within = prepare_within(MODES[recording.mode].curves, key_times, keys, slice(before, before + 1))
        if not together:
            return samples, np.minimum(recording.errors(samples, within(counts, progress, slice(None))), MAX_ERROR)
        counts, progress = (np.concatenate([numbers] * math.prod(together)) for numbers in (counts, progress))
        shown = within(counts, progress, slice(None))
        return samples, np.minimum(recording.errors(samples, reshaped(shown, *together, -1)), MAX_ERROR)


def _at(numbers: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the numbers at some samples (m,), or the one number that holds for all."""
    return numbers[samples] if numbers.ndim else numbers


def _with_ends(recording: SampleTracks, rows: np.ndarray, reach: int) -> tuple[np.ndarray, Poses]:
    """Return times (s, keys) and poses (..., s, keys) of samples; beyond the ends, the motion there is continued.

    Blender's curves come to rest there.
    """
    key_times, keys = recording.times[rows], recording.truth[rows]
    if rows.min() >= 0:
        return key_times, keys
    absent = [np.count_nonzero(columns < 0, axis=1) for columns in (rows[:, :reach], rows[:, reach + 2 :])]
    where = [np.flatnonzero(count) for count in absent]
    inwards = np.repeat((1, -1), [len(some) for some in where])
    (before, after), row = (count[some] for count, some in zip(absent, where, strict=True)), np.concatenate(where)
    missing, outermost = np.concatenate((before, after)), np.concatenate((before, rows.shape[1] - 1 - after))
    duration = key_times[row, outermost + inwards] - key_times[row, outermost]
    for step in range(1, 1 + missing.max()):
        some = missing >= step
        here, inward = row[some], inwards[some]
        column = outermost[some] - step * inward
        key_times[here, column] = key_times[here, outermost[some]] - step * duration[some]
        last = keys[..., here, column + inward]
        goes_on = not MODES[recording.mode].is_reference
        keys[..., here, column] = step_repeated(last, keys[..., here, column + 2 * inward]) if goes_on else last
    return key_times, keys
