"""Keys spread over a recording so that the largest error is as small as so many of them can make it.

Two steps take turns. Keys are laid out anew: of all ways over candidates that have few enough keys, the one whose worst
segment is best is found by dynamic programming, for larger and larger errors until there is a way. Where a segment
depends on more keys than its two, the others are taken to be as far away as the keys of before are there. Then all keys
are moved together, each to one of a few samples near it: for these the best is found exactly, with all keys that have
a say in a segment.

Source: dynamic programming over the samples of a recording as in Roberts, Lewis and Anjyo, "Optimal and interactive
keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from .key_costs import Costs

FIRST_ERROR_RATIO = 0.7
"""Of the largest error of keys: what the next ones are first asked for, and less where that is easy."""

MIN_ERROR_RATIO = 1e-6
"""Of it: no less is asked for, where some keys leave no error at all."""

RAISED_ERROR_RATIO = 1.15
"""How many times as large the error may be each time that there is no way with few enough keys."""

STEP_HALVINGS = 3
"""Of the last step up, by its logarithm."""

LIVE_ERROR_RATIOS = 1.5, 1.2
"""Times the error that a segment may be off by, for longer ones from its first key to be looked at.

Where it depends on its two keys alone, and where on more."""

MAX_SEGMENT_CANDIDATES = 4, 36
"""The most candidates that a segment may reach over: so many times the mean from key to key, and at least so many."""

MAX_LOOKS_PER_SAMPLE = 200
"""Times that every sample may be looked at for segments, on average."""

FULL_REACH_CANDIDATES = 8
"""Candidates that a segment reaches over, up to which it may reach over any number of them: beyond, steps grow."""

BATCH_LENGTHS = 8
"""Lengths of segments that are looked at in one go."""

AT_ONCE = 2**13
"""Candidates, or segments, whose possibilities are worked out in one go."""

LARGEST_ERROR_POWER = 16
"""The power of the largest errors of segments whose sum is least for keys that are moved together."""

KEY_MOVE_STEPS = np.array((0, 1, -1, 2, -2))
"""Where a key may go, in steps towards the worse one of the segments beside it."""


def spread_keys(costs: Costs, candidates: np.ndarray, keys: np.ndarray, budget: int) -> tuple[np.ndarray, bool]:
    """Keys laid out anew: as many as a budget at most, whose worst segment is as good as candidates allow.

    Parameters
    ----------
    costs : Costs
        Of one track, for the largest error.
    candidates : array of int, shape (m,)
        Samples, rising.
    keys : array of int, shape (k,)
        From the first sample to the last, within the budget. They are candidates too.
    budget : int
        At least 2.

    Returns
    -------
    keys : array of int, rising
    is_complete : bool
        Whether all segments that might have been better were looked at.
    """
    ways = _Ways(costs, np.union1d(candidates, keys), keys)
    worst = costs.peak(keys)
    high = FIRST_ERROR_RATIO * worst
    ways.look(high)
    best = ways.fewest(high, budget)
    low = high
    while best is None:
        if high >= worst:
            return keys, False
        low, high = high, min(RAISED_ERROR_RATIO * high, worst)
        ways.look(high)
        best = ways.fewest(high, budget)
    while low == high and low > MIN_ERROR_RATIO * worst:
        low = high / RAISED_ERROR_RATIO
        better = ways.fewest(low, budget)
        best, high = (best, high) if better is None else (better, low)
    for _ in range(STEP_HALVINGS):
        middle = math.sqrt(low * high)
        better = ways.fewest(middle, budget)
        low, high, best = (middle, high, best) if better is None else (low, middle, better)
    return best, ways.is_complete


class _Ways:
    """Segments that join candidates, and how far each is off, looked at as far as errors need it."""

    def __init__(self, costs: Costs, candidates: np.ndarray, keys: np.ndarray) -> None:
        self._costs, self._candidates, self._alive = costs, candidates, LIVE_ERROR_RATIOS[min(costs.reach, 1)]
        longest, lengths = (
            max(MAX_SEGMENT_CANDIDATES[0] * -(-len(candidates) // len(keys)), MAX_SEGMENT_CANDIDATES[1]),
            [1],
        )
        while lengths[-1] < longest:
            lengths.append(lengths[-1] + max(1, lengths[-1] // FULL_REACH_CANDIDATES))
        self._lengths = np.array(lengths)
        self._left = float(MAX_LOOKS_PER_SAMPLE * len(costs.recording.times) * costs.recording.poses_each)
        # The samples of keys 1, 2... further, before each candidate and after it, -1 beyond the ends.
        number = np.arange(len(keys))
        places = np.interp(candidates, keys, number) + np.array(
            [way for way in range(-costs.reach, costs.reach + 1) if way]
        ).reshape(-1, 1)
        # Halves all go up, so that keys stay a sample apart; the last digits are left out, which could say otherwise.
        near = np.floor(np.round(np.interp(places, number, keys), 6) + 0.5).astype(np.int64)
        near = np.where((places < 0) | (places > number[-1]), -1, near)
        self._before, self._after = near[: costs.reach], near[costs.reach :]
        # How many lengths of segments from each candidate have been good enough, and the error of the next.
        self._looked, self._ended = np.zeros(len(candidates), dtype=np.int64), np.zeros(len(candidates))
        own = np.searchsorted(candidates, keys)
        self._pairs = [np.stack((own[:-1], own[1:]))]
        self._peaks = [costs.of(self._windows(*self._pairs[0]))[1]]

    @property
    def is_complete(self) -> bool:
        """Whether there was time to look at all segments for the errors that were asked for."""
        return self._left >= 0.0

    def _windows(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the samples of all keys with a say in segments between candidates (...), shape (..., keys)."""
        rows = (*self._before[:, first], self._candidates[first], self._candidates[second], *self._after[:, second])
        return np.stack(rows, axis=-1)

    def look(self, error: float) -> None:
        """Look at all segments that may be off by an error at most."""
        last = len(self._candidates) - 1
        most = np.searchsorted(self._lengths, last - np.arange(last + 1), side="right")
        while True:
            open_ones = np.flatnonzero((self._ended <= self._alive * error) & (self._looked < most))
            if not len(open_ones):
                return
            for begin in range(0, len(open_ones), AT_ONCE):
                if self._left < 0.0:
                    return
                self._look_from(open_ones[begin : begin + AT_ONCE], self._alive * error)

    def _look_from(self, first: np.ndarray, error: float) -> None:
        """Look at the next few lengths of segments from some candidates."""
        numbers = self._looked[first, None] + np.arange(BATCH_LENGTHS)
        second = first[:, None] + self._lengths[np.minimum(numbers, len(self._lengths) - 1)]
        there = (numbers < len(self._lengths)) & (second < len(self._candidates))
        windows = self._windows(np.broadcast_to(first[:, None], second.shape)[there], second[there])
        peak = np.full(second.shape, math.inf)
        peak[there] = self._costs.of(windows)[1]
        self._left -= self._costs.effort(windows)
        lives = np.logical_and.accumulate(peak <= error, axis=1)
        passed = lives.sum(axis=1)
        self._looked[first] += passed
        at_end = peak[np.arange(len(first)), np.minimum(passed, BATCH_LENGTHS - 1)]
        self._ended[first] = np.where(passed < BATCH_LENGTHS, at_end, 0.0)
        rows, columns = np.nonzero(lives)
        self._pairs.append(np.stack((first[rows], second[rows, columns])))
        self._peaks.append(peak[rows, columns])

    def fewest(self, error: float, budget: int) -> np.ndarray | None:
        """Return the samples of a way of segments that are off by an error at most, with as few keys as a budget.

        None where there is no such way.
        """
        pairs, peaks = np.concatenate(self._pairs, axis=1), np.concatenate(self._peaks)
        self._pairs, self._peaks = [pairs], [peaks]
        first, second = pairs[:, peaks <= error]
        # How far each candidate gets at once, and how far it or any before it does.
        last, farthest = len(self._candidates) - 1, np.arange(len(self._candidates))
        np.maximum.at(farthest, first, second)
        if _steps(np.maximum.accumulate(farthest).tolist(), last, budget) is None:
            return None
        way = _steps(farthest.tolist(), last, budget)
        return self._candidates[way] if way else self._exactly(first, second, budget)

    def _exactly(self, first: np.ndarray, second: np.ndarray, budget: int) -> np.ndarray | None:
        """Return the same over segments that join these candidates."""
        order = np.argsort(first, kind="stable")
        bounds = np.searchsorted(first[order], np.arange(len(self._candidates) + 1)).tolist()
        onwards, back = second[order].tolist(), [0] * len(self._candidates)
        steps = [0] + [budget] * (len(self._candidates) - 1)
        for number, (begin, end) in enumerate(itertools.pairwise(bounds)):
            step = steps[number] + 1
            for place in onwards[begin:end]:
                if step < steps[place]:
                    steps[place], back[place] = step, number
        if steps[-1] >= budget:
            return None
        way = [len(self._candidates) - 1]
        while way[-1]:
            way.append(back[way[-1]])
        return self._candidates[way[::-1]]


def _steps(farthest: list[int], last: int, budget: int) -> list[int] | None:
    """From the first candidate to the last, always as far as one gets; None where that takes more than the budget."""
    way = [0]
    while way[-1] < last:
        if len(way) == budget:
            return None
        way.append(farthest[way[-1]])
    return way


def moved_together(costs: Costs, keys: np.ndarray, ways: int, part: int) -> np.ndarray:
    """All keys but the outermost, each moved to one of a few samples near it, for the best of all choices together.

    Parameters
    ----------
    costs : Costs
        Of one track.
    keys : array of int, shape (k,)
        From the first sample to the last.
    ways : int
        How many samples each has for a choice, the one where it is among them, up to five.
    part : int
        The samples are apart by the smaller distance to the keys beside it over this.
    """
    reach, count = costs.reach, costs.keys
    _, peak = costs.of_keys(keys)
    if not peak.any():
        return keys
    between, step = np.diff(keys), np.zeros(len(keys), dtype=np.int64)
    step[1:-1] = np.maximum(np.minimum(between[1:], between[:-1]) // part, 1)
    step[1:-1] *= np.where(peak[1:] < peak[:-1], -1, 1)
    choices = np.clip(keys[:, None] + step[:, None] * KEY_MOVE_STEPS[:ways], keys[0], keys[-1])
    choices = np.pad(choices, ((reach, reach), (0, 0)), constant_values=-1)
    least, backs = np.zeros((ways,) * (count - 1)), []
    for begin in range(0, len(keys) - 1, AT_ONCE):
        costs_there = _of_choices(costs, choices[begin : begin + AT_ONCE + count - 1], peak.max())
        for of_segment in costs_there:
            total = least[..., None] + of_segment
            backs.append(total.argmin(axis=0).astype(np.int8))
            least = total.min(axis=0)
    chosen = [int(number) for number in np.unravel_index(np.argmin(least), least.shape)][::-1]
    for back in reversed(backs):
        chosen.append(int(back[tuple(chosen[:-count:-1])]))
    return choices[np.arange(len(choices)), chosen[::-1]][reach : len(choices) - reach]


def _of_choices(costs: Costs, choices: np.ndarray, worst: float) -> np.ndarray:
    """Return the cost of segments for all choices of the keys with a say in each, (s, ways, ...), of keys (k, ways)."""
    ways, segments = choices.shape[1], len(choices) - costs.keys + 1
    windows = np.empty((segments, *(ways,) * costs.keys, costs.keys), dtype=np.int64)
    for column in range(costs.keys):
        shape = [ways if axis == column else 1 for axis in range(costs.keys)]
        windows[..., column] = choices[column : column + segments].reshape(segments, *shape)
    # Keys must not pass one another.
    rises = ((np.diff(windows, axis=-1) > 0) | (windows[..., 1:] < 0)).all(axis=-1)
    result = np.full(rises.shape, math.inf)
    result[rises] = np.minimum(costs.of(windows[rises])[1] / worst, 1.0 / np.finfo(float).eps) ** LARGEST_ERROR_POWER
    return result
