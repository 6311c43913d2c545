"""Key search: finds few keys among the samples of recordings, within a tolerance.

Keys are removed as long as the motion stays near enough to the recording: those that matter least first, and many at a
time where they do not influence the same segments. The remaining keys are then moved along the recording to where the
error is smallest, which lets more keys be removed, and so on. A key changes only the segments around it, so all keys
can be tried at once, and a key is tried again only after one near it has changed. The work grows with the length of the
recordings and not with its square.

Source: keys are removed like knots from splines in Lyche and Mørken, "Knot removal for parametric B-spline curves and
surfaces", 1987.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .key_costs import Costs, Found, SampleTracks
from .key_links import linked_keys, traded_keys

PEAK_POWER = 8
"""Power of errors whose sum stands for the largest of them; a power of two."""

MOVE_STEPS_SAMPLES = {PEAK_POWER: np.array((1, -1, 3, -3)), 2: np.array((1, -1, 2, -2, 4, -4, 8, -8))}
"""Steps in samples by which moving a key is tried, for the largest error and for the mean square."""

MAX_SEARCH_ROUNDS = 12
"""Rounds of moving keys and removing more of them, at most."""

NEIGHBOUR_OFFSETS = np.arange(-1, 2)
"""Offsets of the keys that are tried again after a key has changed."""

MOVES_PER_ROUND = 4
"""How often keys are moved in a round."""

MIN_MOVE_GAIN_RATIO = 1e-4
"""Smallest gain of moving a key, as a fraction of the mean cost of a segment."""

LOOSER_TOLERANCE_FACTORS = (1.6, 1.3, 1.15)
"""Multiples of the tolerance within which more keys are removed, before some are put back."""

START_TOLERANCE_RATIOS = {PEAK_POWER: 0.5, 2: 0.25}
"""A stretch whose error is at most this fraction of the tolerance starts with a single key in its middle."""

OTHER_TOLERANCE_FACTORS = (0.9, 1.1, 1.25)
"""Multiples of the tolerance for which keys are searched as well: their places may be better for the mean square."""

MIN_POSTPONED_POSES = 2**13
"""From this many poses on, evaluation is split in two, because the first part may make some of the second needless."""

MAX_FULL_START_SAMPLES = 2**13
"""Up to this many samples, each is a key at first: this takes longer, and finds fewer keys."""

MAX_KEY_SWEEPS = 8
"""Sweeps over all keys to pick those that are changed together."""


@dataclass(eq=False)
class KeySelection:
    """Keys among the samples, with the costs and peaks between them."""

    indices: np.ndarray
    """Samples, shape (k,)."""

    first: np.ndarray
    """The number of the first key of each key's track, shape (k,)."""

    last: np.ndarray
    """The number of the last one, shape (k,)."""

    cost: np.ndarray
    """The sum of powers of the errors from each key to the next, shape (k,), zero after the last key of a track."""

    peak: np.ndarray
    """The largest error there, shape (k,)."""

    stale: np.ndarray
    """Whether anything has changed near a key since moving it was tried, shape (k,)."""

    @property
    def inner(self) -> np.ndarray:
        """The numbers of the keys that can be moved and removed."""
        numbers = np.arange(len(self.indices))
        return numbers[(numbers > self.first) & (numbers < self.last)]

    def around(self, numbers: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the keys in these columns relative to each key, (c, m), and whether they belong to its track."""
        result = numbers[:, None] + columns
        inside = (result >= self.first[numbers][:, None]) & (result <= self.last[numbers][:, None])
        return np.clip(result, 0, len(self.indices) - 1), inside

    def windows(self, numbers: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the samples of the keys in these columns relative to each key, -1 where its track has none, (c, m)."""
        result, inside = self.around(numbers, columns)
        return np.where(inside, self.indices[result], -1)


class KeySearch:
    """The search for keys of recordings under one mode: for the largest error, or with `rms` for the mean square."""

    def __init__(self, recording: SampleTracks, *, rms: bool = False) -> None:
        self.recording, self.power = recording, 2 if rms else PEAK_POWER
        self.costs = Costs(recording, self.power)
        self.reach = self.costs.reach
        self.spacing = 2 + 2 * self.reach
        """Keys at least this far apart, counted in keys, can be tried independently."""

    def within(self, tries: int) -> np.ndarray:
        """Return few samples that, as keys, are within the tolerance."""
        best = self._first_result(1.0)
        if self.power == 2:
            return self._traded(best, tries).indices
        result = [best.indices]
        for looser in LOOSER_TOLERANCE_FACTORS[:tries]:
            keys = self.loosened(best, 1.0, looser)
            best = self._smaller_sets(best, keys)
            result.append(keys.indices)
        if self.is_linkable and tries:
            linked = linked_keys(self.costs, result)
            if len(linked) < len(best.indices):
                best = self.refined(self.measured(linked))
        return best.indices

    def _first_result(self, tolerance: float) -> KeySelection:
        """Start with more keys than needed, and return those that are left."""
        return self.refined(self.thinned(self.started(tolerance), tolerance), tolerance)

    def started(self, tolerance: float) -> KeySelection:
        """Return keys to start from: two for a track if they suffice, else the ends of stretches of 2, 4, 8 samples...

        Stretches double if their errors are within a fraction of the tolerance, and those of both halves were.
        """
        recording, count, reach = self.recording, len(self.recording.times), self.reach
        ends, ending = np.zeros(count, dtype=bool), np.full((len(recording.starts), reach), -1)
        whole = np.column_stack((ending, recording.starts, recording.ends, ending))
        enough = self.costs.of(whole)[1] <= tolerance
        lengths = recording.ends - recording.starts + 1
        is_key, good = ~np.repeat(enough, lengths), ~np.repeat(enough, lengths)
        is_key[recording.starts] = is_key[recording.ends] = ends[recording.ends] = True
        if count <= MAX_FULL_START_SAMPLES:
            return self.measured(np.flatnonzero(is_key))
        last = np.repeat(recording.ends, lengths)
        places, half = np.arange(count) - np.repeat(recording.starts, lengths), 1
        while good.any():
            keys = self._unmeasured(np.flatnonzero((places % (2 * half) == 0) | ends))
            numbers = np.flatnonzero(~ends[keys.indices])
            begins = keys.indices[numbers]
            middles = np.minimum(begins + half, last[begins])
            both = good[begins] & (good[middles] | ends[middles])
            numbers, begins, middles = numbers[both], begins[both], middles[both]
            _, peak = self.costs.of(keys.windows(numbers, np.arange(-reach, 2 + reach)))
            fine = (peak <= START_TOLERANCE_RATIOS[self.power] * tolerance) & ~ends[middles]
            good[:] = False
            good[begins[fine]] = True
            # Stretches half as long as possible leave the search a choice.
            for quarter in (begins[fine], middles[fine]) if half > 1 else ():
                is_key[np.minimum(quarter + half // 2, last[quarter])] = False
            is_key[recording.ends] = True
            half *= 2
        keys = self.measured(np.flatnonzero(is_key))
        return self.densified(keys, tolerance) if self.power != 2 else keys

    def _traded(self, best: KeySelection, tries: int) -> KeySelection:
        """Return keys combined from searches for several tolerances, if they are fewer than the best for this one."""
        if not (self.is_linkable and tries):
            return best
        result = [best.indices, *(self._first_result(other).indices for other in OTHER_TOLERANCE_FACTORS[:tries])]
        traded = traded_keys(self.costs, result)
        return self.refined(self.measured(traded)) if len(traded) < len(best.indices) else best

    @property
    def is_linkable(self) -> bool:
        """Whether the keys of several searches can be combined."""
        return self.reach <= 1 and len(self.recording.starts) == 1

    def measured(self, indices: np.ndarray) -> KeySelection:
        """Return keys at these rising samples, the outermost of each track included, with their costs and peaks."""
        keys = self._unmeasured(indices)
        numbers, segments = self.segments(keys)
        keys.cost[numbers], keys.peak[numbers] = self.costs.of(segments)
        return keys

    def _unmeasured(self, indices: np.ndarray) -> KeySelection:
        """Return keys at these samples, without costs and peaks."""
        recording = self.recording
        first, end = np.searchsorted(indices, recording.starts), np.searchsorted(indices, recording.ends)
        counts = end - first + 1
        return KeySelection(
            indices,
            np.repeat(first, counts),
            np.repeat(end, counts),
            np.zeros(len(indices)),
            np.zeros(len(indices)),
            indices >= 0,
        )

    def segments(self, keys: KeySelection) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of the keys where segments begin, (s,), and the samples of all keys influencing each."""
        numbers = np.flatnonzero(np.arange(len(keys.indices)) < keys.last)
        return numbers, keys.windows(numbers, np.arange(-self.reach, 2 + self.reach))

    def densified(self, keys: KeySelection, tolerance: float) -> KeySelection:
        """Return keys with more added where each segment's error is largest, until all are within the tolerance."""
        while keys.peak.max() > tolerance:
            errors = self.costs.errors(self.segments(keys)[1])
            of_segments = np.maximum.reduceat(errors, keys.indices)
            counts = np.diff(keys.indices, append=len(errors))
            worst = (errors == of_segments.repeat(counts)) & (errors > tolerance)
            more = np.union1d(keys.indices, np.flatnonzero(worst))
            if len(more) == len(keys.indices):
                break  # The rest is rounding.
            keys = self.measured(more)
        return keys

    def loosened(self, keys: KeySelection, tolerance: float, looser: float) -> KeySelection:
        """Return keys within a tolerance, made by putting keys back between too few, which find better places."""
        looser *= tolerance
        fewer = self.moved(self.thinned(self.measured(keys.indices), looser), looser)
        return self.refined(self.densified(fewer, tolerance), tolerance)

    def _smaller_sets(self, best: KeySelection, other: KeySelection) -> KeySelection:
        """Return for each track the smaller set of keys."""
        chosen = []
        for start, end in zip(self.recording.starts, self.recording.ends, strict=True):
            rows = [slice(*np.searchsorted(keys.indices, (start, end + 1))) for keys in (best, other)]
            fewer = rows[1].stop - rows[1].start < rows[0].stop - rows[0].start
            takes_other = fewer and other.peak[rows[1]].max() <= 1.0
            chosen.append(other.indices[rows[1]] if takes_other else best.indices[rows[0]])
        return self.measured(np.concatenate(chosen))

    def refined(self, keys: KeySelection, tolerance: float = 1.0) -> KeySelection:
        """Return keys moved and thinned until none can be removed."""
        for _ in range(MAX_SEARCH_ROUNDS):
            before = len(keys.indices)
            keys = self.thinned(self.moved(keys, tolerance), tolerance)
            if len(keys.indices) == before:
                break
        return keys

    def thinned(self, keys: KeySelection, tolerance: float, fewest: int = 2) -> KeySelection:
        """Return keys without those that can be removed, but no fewer than `fewest`."""
        reach = self.reach
        seen = np.zeros(len(keys.indices), dtype=bool)
        cost, peak = np.zeros((2, len(keys.indices), 1 + 2 * reach))

        def promising(_: np.ndarray, peak: np.ndarray) -> np.ndarray:
            return (self.power == 2) | (peak.max(axis=1) <= tolerance)

        while len(keys.indices) > fewest:
            inner = keys.inner
            unseen = inner[~seen[inner]]
            if len(unseen):
                cost[unseen], peak[unseen] = self.evaluate(self.without(keys, unseen), promising)
                seen[unseen] = True
            rise = cost[inner].sum(axis=1) - self._cost_around(keys, inner)
            most = len(keys.indices) - fewest
            picked = inner[self._removable(rise, peak[inner].max(axis=1), keys, tolerance, most)]
            if not len(picked):
                break
            self._remove(keys, picked, cost, peak)
            left = np.ones(len(seen), dtype=bool)
            left[picked] = False
            near = (picked[:, None] + np.arange(-2 - 3 * reach, 3 + 3 * reach)).ravel()
            seen[near[(near >= 0) & (near < len(seen))]] = False
            seen, cost, peak = seen[left], cost[left], peak[left]
        return keys

    def without(self, keys: KeySelection, numbers: np.ndarray) -> np.ndarray:
        """Return the samples of the keys around each key that share a segment with it, without that key, (c, m)."""
        columns = np.arange(-1 - 2 * self.reach, 2 + 2 * self.reach)
        return keys.windows(numbers, columns[columns != 0])

    def _removable(
        self, rise: np.ndarray, peak: np.ndarray, keys: KeySelection, tolerance: float, most: int
    ) -> np.ndarray:
        """Return which inner keys to remove next: those that raise the cost least, far enough from one another."""
        order = np.argsort(rise, kind="stable")
        order = order[: max(1, len(order) // 4)] if self.power == 2 or not math.isfinite(tolerance) else order
        if self.power != 2:
            order = order[peak[order] <= tolerance]
            order = order[: max(1, len(rise) // 4)]
        picked = spaced(order, self.spacing, len(rise))[:most]
        if self.power == 2 and math.isfinite(tolerance):
            allowed = tolerance**2 * len(self.recording.times)
            picked = picked[keys.cost.sum() + np.cumsum(rise[picked]) <= allowed]
        return picked

    def _remove(self, keys: KeySelection, picked: np.ndarray, cost: np.ndarray, peak: np.ndarray) -> None:
        """Remove the picked keys, and set the costs and peaks of the segments that replace theirs."""
        # The segment from the key before replaces two.
        columns = np.concatenate((np.arange(-1 - self.reach, 0), np.arange(1, 1 + self.reach)))
        segments, inside = keys.around(picked, columns)
        keys.cost[segments[inside]], keys.peak[segments[inside]] = cost[picked][inside], peak[picked][inside]
        near, inside = keys.around(picked, NEIGHBOUR_OFFSETS)
        keys.stale[near[inside]] = True
        removed = np.zeros(len(keys.indices), dtype=np.int64)
        removed[picked] = 1
        before = np.cumsum(removed)
        left = removed == 0
        keys.first, keys.last = ((ends - before[ends])[left] for ends in (keys.first, keys.last))
        for name in ("indices", "cost", "peak", "stale"):
            setattr(keys, name, getattr(keys, name)[left])

    def moved(self, keys: KeySelection, tolerance: float) -> KeySelection:
        """Return the same number of keys, moved along the recording as long as that lowers the cost by much."""
        reach, steps = self.reach, MOVE_STEPS_SAMPLES[self.power]
        columns, of_segments = np.arange(-1 - 2 * reach, 2 + 2 * reach), np.arange(-1 - reach, 1 + reach)
        for _ in range(MOVES_PER_ROUND):
            inner = keys.inner
            inner = inner[keys.stale[inner]]
            trials = keys.indices[inner, None] + steps
            possible = (trials > keys.indices[inner - 1, None]) & (trials < keys.indices[inner + 1, None])
            rows, ways = np.nonzero(possible)
            if not len(rows):
                break
            windows = keys.windows(inner[rows], columns)
            windows[:, 1 + 2 * reach] += steps[ways]
            around, enough = (
                self._cost_around(keys, inner[rows]),
                -MIN_MOVE_GAIN_RATIO * keys.cost.sum() / len(keys.cost),
            )
            rises = functools.partial(self._rises, around=around, tolerance=tolerance)
            cost, peak = self.evaluate(windows, lambda *result, rises=rises, enough=enough: rises(*result) < enough)
            rise = rises(cost, peak)
            order = np.lexsort((rise, rows))
            best = order[np.flatnonzero(np.diff(rows[order], prepend=-1))]
            keys.stale[inner] = False
            best = best[rise[best] < enough]
            if not len(best):
                break
            best = best[np.argsort(rise[best], kind="stable")]
            numbers = inner[rows[best]]
            keys.stale[numbers] = True
            picked = spaced(numbers, self.spacing, len(keys.indices))
            chosen = best[np.argsort(numbers)[np.searchsorted(np.sort(numbers), picked)]]
            segments, inside = keys.around(picked, of_segments)
            keys.cost[segments[inside]], keys.peak[segments[inside]] = cost[chosen][inside], peak[chosen][inside]
            keys.indices = keys.indices.copy()
            keys.indices[picked] += steps[ways[chosen]]
            near, inside = keys.around(picked, NEIGHBOUR_OFFSETS)
            keys.stale[near[inside]] = True
        return keys

    def _rises(self, cost: np.ndarray, peak: np.ndarray, around: np.ndarray, tolerance: float) -> np.ndarray:
        """Return how much the cost around keys rises from `around` (c,) to that of segments (c, s); infinite if too far
        off.
        """
        refused = (self.power != 2) & (peak.max(axis=1) > tolerance)
        return np.where(refused, math.inf, cost.sum(axis=1) - around)

    def _cost_around(self, keys: KeySelection, numbers: np.ndarray) -> np.ndarray:
        """Return the sum of costs over the segments that each key influences."""
        segments, inside = keys.around(numbers, np.arange(-1 - self.reach, 1 + self.reach))
        return np.where(inside, keys.cost[segments], 0.0).sum(axis=1)

    def evaluate(self, windows: np.ndarray, promising: Callable[..., np.ndarray] | None = None) -> Found:
        """Return costs and peaks, each (c, s), of all complete segments between the keys of windows (c, m).

        If there is much to do, the segments half-way through windows come first. The others stay zero where
        `promising`, given those results, rejects a window.
        """
        rows = np.lib.stride_tricks.sliding_window_view(windows, self.costs.keys, axis=1)
        last = rows.shape[1] - 1
        outer = np.abs(2 * np.arange(last + 1) - last) > 1
        if promising is None or self.costs.effort(rows[:, outer]) < MIN_POSTPONED_POSES:
            return self.costs.of(rows)
        cost, peak = np.zeros((2, *rows.shape[:2]))
        cost[:, ~outer], peak[:, ~outer] = self.costs.of(rows[:, ~outer])
        left = np.ix_(promising(cost, peak), outer)
        cost[left], peak[left] = self.costs.of(rows[left])
        return cost, peak


def spaced(order: np.ndarray, distance: int, count: int) -> np.ndarray:
    """Return those numbers below `count`, ordered by worth, that are at least `distance` from any better one."""
    rank = np.full(count + 2 * distance, len(order))
    rank[order + distance] = np.arange(len(order))
    picked: list[np.ndarray] = []
    # Pick all numbers that are the best in their neighbourhood, then repeat with the rest.
    for _ in range(MAX_KEY_SWEEPS):
        centre = rank[distance - 1 : len(rank) - distance + 1]
        best = functools.reduce(np.minimum, (rank[begin : begin + len(centre)] for begin in range(2 * distance - 1)))
        chosen = np.flatnonzero((centre == best) & (centre < len(order)))
        if not len(chosen):
            break
        picked.append(chosen - 1)
        near = chosen[:, None] + distance - 1 + np.arange(1 - distance, distance)
        rank[near.ravel()] = len(order)
    # If each number is better than the next, as at rest where all are equal, picking one by one is quicker.
    for number in order[rank[order + distance] < len(order)].tolist():
        if rank[number + distance] < len(order):
            picked.append(np.array([number]))
            rank[number + 1 : number + 2 * distance] = len(order)
    result = np.concatenate(picked) if picked else np.empty(0, dtype=np.int64)
    ranks = np.empty(count, dtype=np.int64)
    ranks[order] = np.arange(len(order))
    return result[np.argsort(ranks[result])]
