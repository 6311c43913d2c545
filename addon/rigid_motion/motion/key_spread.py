"""Key spreading: distributes a number of keys over a recording so that the largest error is as small as possible.

Two steps take turns. First, keys are laid out anew: of all paths over candidates with few enough keys, dynamic
programming finds the one whose worst segment is best, for larger and larger errors until there is a path. Where a
segment depends on more than its two keys, the others are taken to be as far away as the previous keys are there. Then
all keys are moved together, each to one of a few samples near it. The best choice of these is found exactly, with all
keys that influence a segment.

Source: dynamic programming over the samples of a recording as in Roberts, Lewis and Anjyo, "Optimal and interactive
keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from .key_costs import Costs

FIRST_ERROR_RATIO = 0.7
"""Error that is first asked of new keys, as a fraction of the largest error of the old ones; less if that is easy."""

MIN_ERROR_RATIO = 1e-6
"""Smallest error that is asked for, as the same fraction, for keys that leave no error at all."""

RAISED_ERROR_RATIO = 1.15
"""Factor by which the error is raised each time that no path has few enough keys."""

STEP_HALVINGS = 3
"""Bisections of the last step up, on a logarithmic scale."""

LIVE_ERROR_RATIOS = 1.5, 1.2
"""Multiples of the error up to which longer segments from the same first key are tried.

The first is for segments that depend on their two keys alone, the second for others."""

MAX_SEGMENT_CANDIDATES = 4, 36
"""Longest segment in candidates: this multiple of the mean from key to key, but at least this number."""

MAX_LOOKS_PER_SAMPLE = 200
"""How many times each sample may be evaluated for segments, on average."""

FULL_REACH_CANDIDATES = 8
"""Divisor of a segment's length, in candidates, that gives the step to the next length tried. The step is at
least one."""

BATCH_LENGTHS = 8
"""Lengths of segments evaluated at a time."""

AT_ONCE = 2**13
"""Candidates, or segments, processed at a time."""

LARGEST_ERROR_POWER = 16
"""Power of the largest errors of segments whose sum is minimised when keys are moved together."""

KEY_MOVE_STEPS = np.array((0, 1, -1, 2, -2))
"""Where a key may move, in steps towards the worse of its two segments."""


def spread_keys(costs: Costs, candidates: np.ndarray, keys: np.ndarray, budget: int) -> tuple[np.ndarray, bool]:
    """Return keys laid out anew within a budget, with the worst segment as good as candidates allow.

    Parameters
    ----------
    costs : Costs
        Costs of one track, for the largest error.
    candidates : array of int, shape (m,)
        Samples, rising.
    keys : array of int, shape (k,)
        From the first sample to the last, within the budget. They are candidates, too.
    budget : int
        At least 2.

    Returns
    -------
    keys : array of int, rising
    is_complete : bool
        Whether all segments that could be better were evaluated.
    """
    ways = _CandidateSegments(costs, np.union1d(candidates, keys), keys)
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


class _CandidateSegments:
    """Segments between candidates with their errors, evaluated as far as needed."""

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
        # The samples 1, 2... keys before each candidate and after it, -1 beyond the ends.
        number = np.arange(len(keys))
        places = np.interp(candidates, keys, number) + np.array(
            [way for way in range(-costs.reach, costs.reach + 1) if way]
        ).reshape(-1, 1)
        # All halves are rounded up, so that keys stay a sample apart. Rounding to 6 digits first keeps halves exact.
        near = np.floor(np.round(np.interp(places, number, keys), 6) + 0.5).astype(np.int64)
        near = np.where((places < 0) | (places > number[-1]), -1, near)
        self._before, self._after = near[: costs.reach], near[costs.reach :]
        # How many lengths of segments from each candidate were good enough, and the error of the next.
        self._looked, self._ended = np.zeros(len(candidates), dtype=np.int64), np.zeros(len(candidates))
        own = np.searchsorted(candidates, keys)
        self._pairs = [np.stack((own[:-1], own[1:]))]
        self._peaks = [costs.of(self._windows(*self._pairs[0]))[1]]

    @property
    def is_complete(self) -> bool:
        """Whether there was time to evaluate all segments for the errors asked for."""
        return self._left >= 0.0

    def _windows(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the samples of all keys that influence segments between candidates (...), shape (..., keys)."""
        rows = (*self._before[:, first], self._candidates[first], self._candidates[second], *self._after[:, second])
        return np.stack(rows, axis=-1)

    def look(self, error: float) -> None:
        """Evaluate all segments whose error may be at most this."""
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
        """Evaluate the next few lengths of segments from some candidates."""
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
        """Return the samples of a path over segments with at most this error, with no more keys than the budget.

        None if there is no such path.
        """
        pairs, peaks = np.concatenate(self._pairs, axis=1), np.concatenate(self._peaks)
        self._pairs, self._peaks = [pairs], [peaks]
        first, second = pairs[:, peaks <= error]
        # How far one segment gets from each candidate, and how far from it or any before it.
        last, farthest = len(self._candidates) - 1, np.arange(len(self._candidates))
        np.maximum.at(farthest, first, second)
        if _greedy_path(np.maximum.accumulate(farthest).tolist(), last, budget) is None:
            return None
        way = _greedy_path(farthest.tolist(), last, budget)
        return self._candidates[way] if way else self._shortest_path(first, second, budget)

    def _shortest_path(self, first: np.ndarray, second: np.ndarray, budget: int) -> np.ndarray | None:
        """Return the path with the fewest segments that join these candidates, or None if it exceeds the budget."""
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


def _greedy_path(farthest: list[int], last: int, budget: int) -> list[int] | None:
    """Return the path from the first candidate to the last with the longest steps; None if it exceeds the budget."""
    way = [0]
    while way[-1] < last:
        if len(way) == budget:
            return None
        way.append(farthest[way[-1]])
    return way


def moved_together(costs: Costs, keys: np.ndarray, ways: int, part: int) -> np.ndarray:
    """Return keys, each but the outermost moved to one of a few samples near it, as the best of all choices together.

    Parameters
    ----------
    costs : Costs
        Costs of one track.
    keys : array of int, shape (k,)
        From the first sample to the last.
    ways : int
        How many samples each key can choose from, including its own, up to five.
    part : int
        The step between these samples is the smaller distance to the neighbouring keys, divided by this.
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
    """Return the cost of segments for all choices of the keys (k, ways) that influence them, (s, ways, ...)."""
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
