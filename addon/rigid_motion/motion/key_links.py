"""Shortest paths through a recording, key by key: combines the keys that several searches found into fewer.

Each of two good sets of keys may be better than the other in places. The candidates are the samples of all sets and
those next to them. Every segment that joins two candidates within the tolerance is a link, and dynamic programming
finds the fewest links from the first sample to the last. Where a segment depends on its two keys alone, the result is
exact for these candidates. Where it depends on one more key on either side, a link consists of four keys, and segments
that are far from the tolerance when their neighbours are as far away as they are long are left out. Links with smaller
and smaller errors tell in the same way how small the largest error of a number of keys can be.

For the mean square of the errors, no link is good enough or too bad by itself. There a key has a price, and the
cheapest path counts errors and keys together. The highest price at which the errors are within the tolerance leaves the
fewest keys (Lagrange's multiplier).

Source: dynamic programming over the samples of a recording as in Roberts, Lewis and Anjyo, "Optimal and interactive
keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from .key_costs import Costs

LIVE_ERROR_PER_TOLERANCE = 1.5
"""Error in tolerances up to which a segment is kept where it depends on more than two keys. Longer segments from its
first key are tried up to the square of this."""

CANDIDATE_WIDTHS_BY_REACH = {0: (3, 1), 1: (1, 0)}
"""How many samples next to keys are candidates, by the reach of the mode: the first width that the effort allows."""

MAX_LOOKS_PER_SAMPLE = 100
"""How many times each sample may be evaluated, on average."""

MAX_PAIR_LOOKS_PER_SAMPLE = 200
"""The same for pairs of candidates if a segment depends on more than its two keys; more does not find fewer keys."""

BUDGET_WIDTH_BY_REACH = {0: 2, 1: 0}
"""The width for keys within a budget, for any effort."""

LIVE_ERROR_PER_LEAST = 1.2
"""Longer segments are tried up to this many times the least error so far, for keys within a budget."""

MAX_BUDGET_LOOKS_PER_SAMPLE = 300
"""How many times each sample may be evaluated, on average, for keys within a budget."""

BEST_KEYS_KEPT = 4
"""How many of the best sets of keys are combined, if all sets have too many links."""

MAX_LINK_ERROR_PER_TOLERANCE = 1.0 + 1e-12
"""Largest error of a link, in tolerances. It allows for rounding, so the links of known keys are always included."""

BATCH_LENGTHS = 8
"""Lengths of segments evaluated at a time where a pose costs little, even if some would be enough."""

MAX_SEGMENT_COST_KEYS = 3.0
"""Largest cost of a segment, in prices of a key: beyond that one more key is worth it."""

MAX_PRICE_RATIO = 8.0
"""Largest factor between the price and its first estimate, in either direction."""

PRICE_STEPS = 10
"""Steps of bisecting the price."""


def linked_keys(costs: Costs, result: list[np.ndarray]) -> np.ndarray:
    """Return the fewest keys that candidates allow, or the smallest set of `result` if that takes too long.

    Parameters
    ----------
    costs : Costs
        Costs of one track, for the largest error, under a mode that reaches no further than one key beyond a segment.
    result : list of array of int
        Sets of keys within the tolerance, each from the first sample to the last.
    """
    for width in CANDIDATE_WIDTHS_BY_REACH[costs.reach]:
        candidates = samples_near(costs, result, width)
        links = _links(
            costs,
            candidates,
            result,
            1.0 if costs.reach == 0 else LIVE_ERROR_PER_TOLERANCE,
            LIVE_ERROR_PER_TOLERANCE**2,
        )
        if links is not None:
            _, peak = costs.of(links)
            links = links[peak <= MAX_LINK_ERROR_PER_TOLERANCE]
            keys = _Paths(links, candidates).shortest()
            assert keys is not None  # what was found is a way
            return keys
    return min(result, key=len)


def traded_keys(costs: Costs, result: list[np.ndarray], *, budget: int | None = None) -> np.ndarray:
    """Return the fewest keys found by varying the price of a key, or the first of `result` if that takes too long.

    With a budget, return the keys within it that have the lowest cost.

    Parameters
    ----------
    costs : Costs
        Costs of one track, for the mean square, under a mode that reaches no further than one key beyond a segment.
    result : list of array of int
        Sets of keys from the first sample to the last: one within the tolerance, then larger and smaller ones.
    budget : int, optional
        The most keys, instead of a tolerance.
    """
    counts, totals = [len(keys) for keys in result], [costs.total(keys) for keys in result]
    allowed = float(len(costs.recording.times))
    best, least = result[0], (counts[0], totals[0]) if budget is None else (totals[0], counts[0])
    if max(counts) == min(counts) or max(totals) == min(totals):
        return best
    price = (max(totals) - min(totals)) / (max(counts) - min(counts))
    candidates = samples_near(costs, result, 0)
    links = _links(costs, candidates, result, MAX_SEGMENT_COST_KEYS * price, MAX_SEGMENT_COST_KEYS**2 * price)
    if links is None:
        return best
    (cost, _), ways = costs.of(links), _Paths(links, candidates)
    low, high = -math.log(MAX_PRICE_RATIO), math.log(MAX_PRICE_RATIO)
    for _ in range(PRICE_STEPS):
        middle = 0.5 * (low + high)
        keys = ways.shortest(cost + price * math.exp(middle))
        assert keys is not None  # what was found is a way
        total = costs.total(keys)
        worth = (len(keys), total) if budget is None else (total, len(keys))
        fits = total <= allowed if budget is None else len(keys) <= budget
        # If the result does not fit, keys are too dear, or with a budget too cheap.
        low, high = (middle, high) if fits == (budget is None) else (low, middle)
        if fits and worth < least:
            best, least = keys, worth
    return best


def joined_keys(costs: Costs, result: list[np.ndarray], budget: int) -> np.ndarray:
    """Return the keys within a budget with the smallest largest error that candidates allow, or the best of `result`.

    Parameters
    ----------
    costs : Costs
        Costs of one track, for the largest error, under a mode that reaches no further than one key beyond a segment.
    result : list of array of int
        Sets of keys, each from the first sample to the last, with at least one within the budget.
    budget : int
    """
    within = sorted((keys for keys in result if len(keys) <= budget), key=costs.peak)
    best, high = within[0], costs.peak(within[0])
    for some in (result, within[:BEST_KEYS_KEPT]):
        candidates = samples_near(costs, some, BUDGET_WIDTH_BY_REACH[costs.reach])
        links = _links(costs, candidates, some, high, LIVE_ERROR_PER_LEAST * high, MAX_BUDGET_LOOKS_PER_SAMPLE)
        if links is not None:
            break
    else:
        return best
    _, peak = costs.of(links)
    better = peak < high
    links, peak = links[better], peak[better]
    ways, levels = _Paths(links, candidates), _sorted_distinct(peak)
    low, high = 0, len(levels)
    while low < high:
        middle = (low + high) // 2
        keys = ways.shortest(among=peak <= levels[middle])
        if keys is None or len(keys) > budget:
            low = middle + 1
        else:
            best, high = keys, middle
    return best


def samples_near(costs: Costs, result: list[np.ndarray], width: int) -> np.ndarray:
    """Return the samples that are keys in any set, and this many samples on either side of each."""
    near = np.concatenate(result)[:, None] + np.arange(-width, width + 1)
    return _sorted_distinct(np.clip(near, 0, len(costs.recording.times) - 1).ravel())


def _links(
    costs: Costs,
    candidates: np.ndarray,
    result: list[np.ndarray],
    good: float,
    alive: float,
    effort: float = MAX_LOOKS_PER_SAMPLE,
) -> np.ndarray | None:
    """Return the links that candidates allow: samples, -1 beyond the ends, (l, keys of a segment); None if too many.

    Segments whose peak (or cost, for the mean square) is above `good` are left out, and those above `alive` are not
    made longer. For this their neighbours are as far away as they are long.
    """
    pairs = _pairs(costs, candidates, result, good, alive)
    if pairs is None:
        return None
    if costs.reach == 0:
        return candidates[pairs]
    before, after = _neighbours(pairs, len(candidates))
    # There are many more links than pairs: they are counted before any is made.
    poses = (before * after * (candidates[pairs[:, 1]] - candidates[pairs[:, 0]] - 1)).sum()
    if poses > effort * len(costs.recording.times):
        return None
    numbers = _with_neighbours(pairs, len(candidates))
    return np.where(numbers >= 0, candidates[np.maximum(numbers, 0)], -1)


def _pairs(
    costs: Costs, candidates: np.ndarray, result: list[np.ndarray], good: float, alive: float
) -> np.ndarray | None:
    """Return pairs of candidates that a segment may join, (p, 2), sorted; None if they take too long."""
    last, reach = len(candidates) - 1, costs.reach
    left = MAX_PAIR_LOOKS_PER_SAMPLE * len(costs.recording.times) * costs.recording.poses_each if reach else math.inf
    pairs = [np.searchsorted(candidates, np.stack((keys[:-1], keys[1:]), axis=1)) for keys in result]
    first, gap = np.arange(last), 1
    while len(first):
        gaps = gap + np.arange(BATCH_LENGTHS if costs.recording.poses_each == 1.0 else 1)
        second = first[:, None] + gaps
        # A segment at the end has no neighbour there. All others have one, even if it is not as far away.
        numbers = first[:, None, None] + gaps[:, None] * np.arange(-reach, 2 + reach)
        windows = candidates[np.clip(numbers, 0, last)]
        windows[first == 0, :, :reach] = -1
        windows[second >= last, 2 + reach :] = -1
        left -= costs.effort(windows)
        if left < 0.0:
            return None
        cost, peak = costs.of(windows)
        worth = cost if costs.power == 2 else peak
        worth[second > last] = math.inf
        lives = np.logical_and.accumulate(worth <= alive, axis=1)
        is_good = worth <= good
        is_good[:, 1:] &= lives[:, :-1]
        pairs.append(np.stack((np.broadcast_to(first[:, None], is_good.shape)[is_good], second[is_good]), axis=1))
        first, gap = first[lives[:, -1]], gap + len(gaps)
        first = first[first + gap <= last]
    numbers = np.concatenate(pairs) @ (last + 1, 1)
    return np.stack(np.divmod(_sorted_distinct(numbers), last + 1), axis=1)


def _sorted_distinct(numbers: np.ndarray) -> np.ndarray:
    """Return the distinct numbers, sorted. Faster than `np.unique` if most of them differ."""
    numbers = np.sort(numbers)
    return numbers[np.append(True, numbers[1:] != numbers[:-1])[: len(numbers)]]


def _neighbours(pairs: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how many pairs end where each begins, and begin where it ends, 1 beyond the ends. Both (p,)."""
    begun, ended = (np.bincount(column, minlength=count) for column in pairs.T)
    return np.maximum(ended[pairs[:, 0]], pairs[:, 0] == 0), np.maximum(begun[pairs[:, 1]], pairs[:, 1] == count - 1)


def _with_neighbours(pairs: np.ndarray, count: int) -> np.ndarray:
    """Return every pair with all pairs that end where it begins and begin where it ends: (l, 4), -1 beyond the ends."""
    by_end = pairs[np.argsort(pairs[:, 1], kind="stable")]
    begins, ends = (np.searchsorted(column, np.arange(count + 1)) for column in (pairs[:, 0], by_end[:, 1]))
    before, after = _neighbours(pairs, count)
    numbers = np.repeat(np.arange(len(pairs)), before * after)
    offsets = np.arange(len(numbers)) - np.repeat(np.cumsum(before * after) - before * after, before * after)
    from_before, to_after = np.divmod(offsets, after[numbers])
    first, second = pairs[numbers].T
    most = len(pairs) - 1
    return np.stack(
        (
            np.where(first > 0, by_end[np.minimum(ends[first] + from_before, most), 0], -1),
            first,
            second,
            np.where(second < count - 1, pairs[np.minimum(begins[second] + to_after, most), 1], -1),
        ),
        axis=1,
    )


class _Paths:
    """Paths over links (l, keys) from the first candidate to the last: successive links share all keys but one."""

    def __init__(self, links: np.ndarray, candidates: np.ndarray) -> None:
        second = links.shape[1] // 2
        self._order = np.argsort(links[:, second - 1], kind="stable")
        links, self._end = links[self._order], int(candidates[-1])
        self._begins = links[:, second - 1]
        # The keys that a link shares with the link before and the link after, as numbers: 0 at the start, 1 at the end.
        shared = np.zeros((2, len(links)), dtype=np.int64)
        for column in range(links.shape[1] - 1):
            shared = shared * (self._end + 2) + links[:, column : column + 2].T + 1
        shared[0, self._begins == candidates[0]] = -2
        shared[1, links[:, second] == self._end] = -1
        result, numbers = np.unique(np.append(shared, (-2, -1)), return_inverse=True)
        self._from, self._to, self._count = *numbers[:-2].reshape(2, -1), len(result)

    def shortest(self, lengths: np.ndarray | None = None, among: np.ndarray | None = None) -> np.ndarray | None:
        """Return all samples on the path with the smallest sum of `lengths` (l,), or by default with the fewest links.

        Only links `among` (l,) are used, if given. None if no path reaches the end.
        """
        taken = slice(None) if among is None else among[self._order]
        begins, ends = self._from[taken].tolist(), self._to[taken].tolist()
        each = itertools.repeat(1) if lengths is None else lengths[self._order][taken].tolist()
        reached, back = [math.inf] * self._count, [-1] * self._count
        reached[0] = 0.0
        for number, (begin, end, length) in enumerate(zip(begins, ends, each, strict=False)):
            way = reached[begin] + length
            if way < reached[end]:
                reached[end], back[end] = way, number
        if back[1] < 0:
            return None
        samples, way, place = self._begins[taken].tolist(), [self._end], 1
        while place:
            way.append(samples[back[place]])
            place = begins[back[place]]
        return np.array(way[::-1])
