"""The search for a given number of keys that follow a recording as closely as possible.

Keys are removed until the number is reached. For the largest error they are then laid out anew and moved together. If
more keys than its two influence a segment, a search follows for a tolerance a little below the remaining error, as
bisecting the tolerance would do. Then the best keys are combined from all that was found, and a search of this kind is
tried once or twice more from there. If a segment depends on its two keys alone and there are few samples per key,
nearly all samples are candidates, and the first layout is the best there is, except for a few hundredths. For the mean
square, some more keys are inserted, moved, and as many removed.

Within a tolerance a few budgets are tried, each for fewer keys than are known to suffice; only one in long recordings,
and none in those of whole bodies. With Blender's own curves every key influences the whole motion, which no search by
segments sees: there the whole motion is evaluated.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from .key_costs import SampleTracks
from .key_links import MAX_LINK_ERROR_PER_TOLERANCE, joined_keys, traded_keys
from .key_search import MAX_FULL_START_SAMPLES, MAX_SEARCH_ROUNDS, KeySearch, KeySelection, spaced
from .key_spread import moved_together, spread_keys
from .modes import MODES, interpolate

CANDIDATES_PER_KEY = 5, 6
"""Candidates for each key of a budget, when its keys are first laid out anew.

The first is for segments that depend on their two keys alone, the second for others."""

CANDIDATE_THINNING = 3
"""Factor by which there are fewer candidates each time after that."""

MAX_CALM_ERROR_RATIO = 0.005
"""A sample is calm if leaving it out alone makes at most this fraction of the largest error of the first keys."""

CALM_CANDIDATE_STRIDE = 4
"""One in this many calm samples is a candidate."""

SAMPLES_PER_KEY_LIMITS = 5, 10, 50
"""Samples per key at which settings change. In the middle, from 10 to 50, there is time for every step.

With fewer, the work for each key takes longer than evaluating samples. With more, evaluating samples takes so long that
another try is worth more."""

JOINT_MOVES_BY_REACH = {0: ((5, 6), (5, 12), (5, 24)), 1: ((2, 6), (3, 12), (2, 24), (2, 48)), 2: ((2, 6), (2, 12))}
"""How keys are moved together, by the reach of the mode: places per key, and the divisor of their distance for the
step."""

STEPS_BY_LENGTH = slice(1, 2), slice(2), slice(None), slice(2)
"""Which of these steps are done, by the ranges of samples per key."""

FIRST_STEP = slice(1)
"""The first step alone: for splines with the fewest samples per key, and after the search for a tolerance."""

TIGHTER_ERROR_PER_TOLERANCE, LOOSER_ERROR_PER_TOLERANCE = 1.05, 1.6
"""The largest error over the tolerance of the search for better keys, and how much looser that is on the way."""

CLOSING_ERROR_PER_TOLERANCE, MAX_CLOSINGS = 1.03, 2
"""The same for the last searches, without a looser factor, and their number at most."""

MAX_INSERTED_KEYS = 8
"""Keys inserted at a time at most, where each lowers the error; or else half of those that are missing."""

MAX_SWAPPED_BUDGET_RATIO = 1.15
"""For the mean square, the number of keys may temporarily be this many times the budget to find better places."""

FEWER_KEYS_RATIOS, NEAR_KEYS_RATIO = (0.9, 0.95), 0.03
"""Budgets tried first and later, as fractions of the keys known to suffice, and the fraction of these by which the last
budget may differ from too few."""

MAX_ERROR_POWER = 4.0
"""Greatest power of the number of keys with which an error mostly falls. It gives the next budget to try."""

HOPELESS_ERROR_PER_TOLERANCE = 1.25
"""Largest error, in tolerances, above which nothing that follows brings keys within the tolerance."""

MANY_POSES = 2**10
"""Above this many poses only one budget is tried, and for whole bodies none: none of 12 trials found anything, and they
took 2.5 times as long."""


def fewest_keys(recording: SampleTracks, budget: int | None, tries: int, *, rms: bool = False) -> np.ndarray:
    """Return the fewest samples within the tolerance of a recording, or the best ones within a budget."""
    if len(recording.times) <= 2:
        return np.arange(len(recording.times))
    if budget is not None:
        return BudgetSearch(recording, budget, rms=rms).least(tries)
    search = KeySearch(recording, rms=rms)
    return _with_smaller_budgets(search, search.within(tries), tries)


def _with_smaller_budgets(search: KeySearch, keys: np.ndarray, tries: int) -> np.ndarray:
    """Return the fewest keys whose motion is within the tolerance, from given keys and searches with a few budgets."""
    recording, best, too_few = search.recording, _with_more_keys(search, keys), 1
    budgets = tries + 1 if tries else 0
    if len(recording.times) * recording.poses_each > MANY_POSES:
        budgets = min(tries, 1) if recording.poses_each == 1.0 else 0
    # Where many keys had to be inserted, the fewest are near the number before that.
    budget = min(math.floor(FEWER_KEYS_RATIOS[0] * len(best)), 1 + math.ceil(len(keys) / FEWER_KEYS_RATIOS[0]))
    for _ in range(budgets):
        budget = max(budget, too_few + 1)
        if budget >= len(best) or len(best) - too_few <= max(1, NEAR_KEYS_RATIO * len(best)):
            break
        other = BudgetSearch(recording, budget, rms=search.power == 2, enough=1.0)
        other.costs = search.costs  # Costs of segments are the same for all budgets.
        fewer = other.least(tries)
        error = _error(search, fewer)
        if error > MAX_LINK_ERROR_PER_TOLERANCE:
            too_few, fewer = budget, _with_more_keys(search, fewer)
        if len(fewer) < len(best):
            best = _without_needless(search, fewer)
            too_few = too_few if too_few < len(best) else 1
            budget = max(math.floor(FEWER_KEYS_RATIOS[1] * len(best)), (too_few + len(best)) // 2)
        else:
            budget = math.ceil(budget * error ** (1.0 / MAX_ERROR_POWER))
        if too_few > 1:
            budget = min(budget, 1 + math.ceil(too_few / FEWER_KEYS_RATIOS[0]))
    return _without_needless(search, best)


def _without_needless(search: KeySearch, keys: np.ndarray) -> np.ndarray:
    """Return the keys without those that the motion does not need to stay within the tolerance."""
    if not MODES[search.recording.mode].is_reference:
        return search.refined(search.measured(keys)).indices
    inner = (measured := search.measured(keys)).inner
    _, peak = search.evaluate(search.without(measured, inner))
    for key in keys[inner[(peak.max(axis=1) <= HOPELESS_ERROR_PER_TOLERANCE) | (search.power == 2)]]:
        fewer = keys[keys != key]
        if _error(search, fewer) <= MAX_LINK_ERROR_PER_TOLERANCE:
            keys = fewer
    return keys


def _with_more_keys(search: KeySearch, keys: np.ndarray) -> np.ndarray:
    """Return the keys with more of them where the motion exceeds the tolerance."""
    while _error(search, keys) > MAX_LINK_ERROR_PER_TOLERANCE:
        errors = _errors(search, keys)
        worst = np.array([first + int(np.argmax(errors[first:second])) for first, second in pairwise(keys.tolist())])
        of_worst = errors[worst]
        keys = np.union1d(keys, worst[of_worst > min(1.0, 0.9 * of_worst.max())])
    return keys


def _errors(search: KeySearch, keys: np.ndarray) -> np.ndarray:
    """Return the error of the whole motion between keys at every sample, in tolerances, shape (n,)."""
    recording = search.recording
    if not MODES[recording.mode].is_reference:
        return search.costs.errors(search.segments(search.measured(keys))[1])
    shown = interpolate(recording.times[keys], recording.poses[..., keys], recording.times, recording.mode)
    errors = recording.errors(np.arange(len(recording.times)), shown)
    errors[keys] = 0.0  # Only rounding is left there.
    return errors


def _error(search: KeySearch, keys: np.ndarray) -> float:
    """Return the error that counts: the largest, or the root mean square."""
    errors = _errors(search, keys)
    return float(np.sqrt(np.square(errors).mean()) if search.power == 2 else errors.max())


class BudgetSearch(KeySearch):
    """The search for a number of keys under one mode: for the largest error, or with `rms` for the mean square.

    If a largest error is `enough`, in tolerances, the search ends when it is reached or far away.
    """

    def __init__(self, recording: SampleTracks, budget: int, *, rms: bool = False, enough: float = 0.0) -> None:
        super().__init__(recording, rms=rms)
        self.budget, self.enough = budget, enough
        self._length = int(np.searchsorted(SAMPLES_PER_KEY_LIMITS, len(recording.times) / budget, side="right"))
        self._is_short = self._length < 2
        """Whether there are few samples per key."""
        self._takes_all = self.reach == 0 and self._is_short
        """Whether all samples are candidates."""

    def least(self, tries: int) -> np.ndarray:
        """Return keys within the budget with the smallest error that can be found, or two keys if nothing moves."""
        count = len(self.recording.times)
        if not np.ptp(self.recording.truth.rows, axis=-1).any():
            return np.array((0, count - 1))
        keys = self.measured(np.arange(count))
        if not self._takes_all:
            keys = self.thinned(keys, math.inf, CANDIDATES_PER_KEY[min(self.reach, 1)] * self.budget)
        candidates = keys.indices
        keys = self.thinned(keys, math.inf, self.budget)
        if self.power == 2:
            return self._least_squares(self._settled(keys), tries)
        return self._least_peak(keys, candidates, tries) if tries else self._settled(keys).indices

    def _moving_samples(self, calm: float) -> np.ndarray:
        """Return all samples, but only every few of those whose error is at most `calm` when left out alone."""
        samples = np.arange(len(self.recording.times))
        _, peak = self.costs.of(np.stack((samples[:-2], samples[2:]), axis=1))
        is_lively = samples % CALM_CANDIDATE_STRIDE == 0
        is_lively[1:-1] |= peak > calm
        is_lively[-1] = True
        return samples[is_lively]

    def _least_peak(self, keys: KeySelection, candidates: np.ndarray, tries: int) -> np.ndarray:
        """Return the keys with the smallest largest error of all that the tries lead to."""
        if self._takes_all:
            candidates = self._moving_samples(MAX_CALM_ERROR_RATIO * keys.peak.max())
        if self.reach and not self._is_short:
            keys = self._settled(keys)
        elif self._length == 2:
            keys = self.moved(keys, math.inf)
        steps = FIRST_STEP if self.reach and self._length == 0 else STEPS_BY_LENGTH[self._length]
        samples, result = keys.indices, [keys.indices]
        for _ in range(min(tries, 2 if self.reach and not self._is_short else 1)):
            if self.costs.peak(samples) <= self.enough:
                break
            samples, is_complete = spread_keys(self.costs, candidates, samples, self.budget)
            moved = self._moved_together(samples, steps)
            # With many samples per key, similar sets only make combining them slower.
            result += [min(moved, key=self.costs.peak)] if self.reach and not self._is_short else moved
            samples = moved[-1]
            if self._takes_all and is_complete:
                return min(result, key=self.costs.peak)
            candidates = candidates[::CANDIDATE_THINNING]
        best = min(result, key=self.costs.peak)
        # If segments depend on their two keys alone there is little left to gain, and long recordings take long.
        is_long = len(self.recording.times) > MAX_FULL_START_SAMPLES and not self.reach
        if is_long or self._is_over(best):
            return best
        if self.reach:
            result += self._searched_by_tolerance(best)
            best = min(result, key=self.costs.peak)
        if self.is_linkable and not self._is_over(best):
            # If segments depend on their two keys alone, all sets are similar: the two best suffice.
            by_peak = {self.costs.peak(keys): keys for keys in result}
            result = [by_peak[peak] for peak in sorted(by_peak)[: None if self.reach else 2]]
            joined = self.filled(self.measured(joined_keys(self.costs, result, self.budget))).indices
            best = min(best, joined, key=self.costs.peak)
        return self._improved_at_worst(best) if self.reach and not self._is_over(best) else best

    def _is_over(self, best: np.ndarray) -> bool:
        """Return whether no more can be done for the best keys."""
        peak = self.costs.peak(best)
        return peak <= self.enough or 0.0 < HOPELESS_ERROR_PER_TOLERANCE * self.enough < peak

    def _searched_by_tolerance(self, best: np.ndarray) -> list[np.ndarray]:
        """Return keys found from the best ones by a search for a tolerance, brought to the budget."""
        tolerance = self.costs.peak(best) / TIGHTER_ERROR_PER_TOLERANCE
        keys = self.loosened(self.measured(best), tolerance, LOOSER_ERROR_PER_TOLERANCE)
        if len(keys.indices) > self.budget:
            keys = self.thinned(keys, math.inf, self.budget)
        result = [self.filled(keys).indices]
        if self._length == 1:  # With fewer samples per key this takes too long, with more it finds little.
            result += self._moved_together(min(best, *result, key=self.costs.peak), FIRST_STEP)
        return result

    def _improved_at_worst(self, best: np.ndarray) -> np.ndarray:
        """Return the best keys, or better ones with some inserted at the worst places and others removed."""
        for _ in range(MAX_CLOSINGS):
            tolerance = self.costs.peak(best) / CLOSING_ERROR_PER_TOLERANCE
            if tolerance == 0.0:
                break
            keys = self.refined(self.densified(self.measured(best), tolerance), tolerance)
            if len(keys.indices) > self.budget:
                break
            best = min(best, self.filled(keys).indices, key=self.costs.peak)
        return best

    def filled(self, keys: KeySelection, most: int | None = None) -> KeySelection:
        """Return keys with more inserted where the error is largest, up to the budget or to `most`."""
        most = min(most or self.budget, len(self.recording.times))
        columns = np.arange(-2 * self.reach, 2 + 2 * self.reach)
        while (left := most - len(keys.indices)) > 0:
            trials = np.flatnonzero(np.diff(keys.indices) > 1)
            errors = self.costs.errors(self.segments(keys)[1][trials])
            ends = zip(keys.indices[trials] + 1, keys.indices[trials + 1], strict=True)
            worst = np.array([first + np.argmax(errors[first:second]) for first, second in ends])
            windows = np.insert(keys.windows(trials, columns), 1 + 2 * self.reach, worst, axis=1)
            peak, before = self.evaluate(windows)[1].max(axis=1), keys.peak[trials]
            # The worst segments get one key each, but segments where that raises the error come last.
            is_better = peak < before
            order = np.argsort(np.where(is_better, -before, peak), kind="stable")
            picked = np.searchsorted(trials, spaced(trials[order], self.spacing, len(keys.indices)))
            picked = picked[: max((left + 1) // 2, min(left, MAX_INSERTED_KEYS, np.count_nonzero(is_better[picked])))]
            keys = self.measured(np.union1d(keys.indices, worst[picked]))
        return keys

    def _moved_together(self, samples: np.ndarray, steps: slice) -> list[np.ndarray]:
        """Return the keys filled up to the budget, and what each step of moving them together makes of them."""
        result = [self.filled(self.measured(samples)).indices]
        for ways, part in JOINT_MOVES_BY_REACH[min(self.reach, 2)][steps]:
            result.append(moved_together(self.costs, result[-1], ways, part))
        return result

    def _least_squares(self, best: KeySelection, tries: int) -> np.ndarray:
        """Return keys with the smallest mean square, starting from keys within the budget."""
        result = [best.indices]
        links = tries and self.is_linkable  # The last try.
        for _ in range(tries - bool(links)):
            # Insert some more where the error is largest, then move all.
            more = self.filled(self.measured(best.indices), math.ceil(MAX_SWAPPED_BUDGET_RATIO * self.budget))
            more = self.moved(more, math.inf)
            result.append(more.indices)
            best = self._better_of(best, more)
        if links:
            traded = traded_keys(self.costs, result, budget=self.budget)
            best = self._better_of(best, self.measured(traded))
        return best.indices

    def _better_of(self, best: KeySelection, other: KeySelection) -> KeySelection:
        """Return the keys with the smaller sum of squares, after bringing the others to the budget."""
        keys = self.measured(other.indices)
        if len(keys.indices) > self.budget:
            keys = self.thinned(keys, math.inf, self.budget)
        keys = self.moved(self.filled(self.moved(keys, math.inf)), math.inf)
        return keys if keys.cost.sum() < best.cost.sum() else best

    def _settled(self, keys: KeySelection) -> KeySelection:
        """Return keys moved to where the sum of powers of the errors is smallest."""
        for _ in range(MAX_SEARCH_ROUNDS):
            before = keys.cost.sum()
            keys = self.moved(keys, math.inf)
            if not keys.cost.sum() < 0.99 * before:
                break
        return keys
