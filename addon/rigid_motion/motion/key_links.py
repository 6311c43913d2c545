"""The shortest way through recordings, key by key: few keys, put together from what several searches have found.

Of two good sets of keys each may be better than the other in places. The candidates are the samples of all of them and
those next to them; every segment that joins two and keeps to the tolerance is a link, and the fewest links from the
first sample to the last are found by dynamic programming. Where a segment depends on its two keys alone that is exact
for these candidates. Where it depends on one key more on either side, a link is made of four keys; segments that are
far from the tolerance with neighbours as far away as they are long are left out.

Source: dynamic programming over the samples of a recording as in Roberts, Lewis and Anjyo, "Optimal and interactive
keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .key_search import Search

ALIVE = 1.5
"""Tolerances that a segment may be off by, for it or a longer one to be looked at further."""

WIDTHS = {0: (3, 1), 1: (1, 0)}
"""By how many samples candidates may be beside keys, by the reach of the mode: as many as the effort allows."""

EFFORT = 100
"""Times that every sample may be looked at, on average."""

WITHIN = 1.0 + 1e-12
"""Tolerances that a link may be off by: those of the keys that were found are among them, whatever the rounding."""

TOGETHER = 4
"""Lengths of segments that are looked at in one go, though that of some would be enough, where a pose costs little."""

MANY = 2**40
"""Keys, more than there are."""


def linked_keys(search: Search, found: list[np.ndarray]) -> np.ndarray:
    """The fewest keys that candidates allow, or the fewest that were found; at all costs that are too high.

    Parameters
    ----------
    search : Search
        Of one track, for the largest error, under a mode that reaches no further than one key beyond a segment.
    found : list of array of int
        Keys that keep to the tolerance, each from the first sample to the last.
    """
    fewest = min(found, key=len)
    count = len(search.recording.times)
    for width in WIDTHS[search.reach]:
        beside = np.concatenate(found)[:, None] + np.arange(-width, width + 1)
        candidates = np.unique(np.clip(beside, 0, count - 1))
        pairs = _pairs(search, candidates, found)
        if search.reach == 0:
            return candidates[_shortest(pairs, len(candidates))]
        before, after = _neighbours(pairs, len(candidates))
        # Links are many times the pairs: they are counted before any is made.
        if (before * after * (candidates[pairs[:, 1]] - candidates[pairs[:, 0]] - 1)).sum() <= EFFORT * count:
            links = _links(pairs, len(candidates))
            samples = np.where(links >= 0, candidates[np.maximum(links, 0)], -1)
            _, peak = search.costs.of(samples)
            return candidates[_shortest_of_four(links[peak <= WITHIN])]
    return fewest


def _pairs(search: Search, candidates: np.ndarray, found: list[np.ndarray]) -> np.ndarray:
    """Candidates that a segment may join, (p, 2), by the first and then the second."""
    last, reach = len(candidates) - 1, search.reach
    pairs = [np.searchsorted(candidates, np.stack((keys[:-1], keys[1:]), axis=1)) for keys in found]
    first, gap = np.arange(last), 1
    while len(first):
        gaps = gap + np.arange(TOGETHER if search.recording.poses_each == 1.0 else 1)
        second = first[:, None] + gaps
        # A segment at the end has no neighbour there; all others have one, if not as far away.
        numbers = first[:, None, None] + gaps[:, None] * np.arange(-reach, 2 + reach)
        windows = candidates[np.clip(numbers, 0, last)]
        windows[first == 0, :, :reach] = -1
        windows[second >= last, 2 + reach :] = -1
        _, peak = search.costs.of(windows)
        peak[second > last] = math.inf
        alive = np.logical_and.accumulate(peak <= ALIVE**2, axis=1)
        good = peak <= (1.0 if reach == 0 else ALIVE)
        good[:, 1:] &= alive[:, :-1]
        pairs.append(np.stack((np.broadcast_to(first[:, None], good.shape)[good], second[good]), axis=1))
        first, gap = first[alive[:, -1]], gap + len(gaps)
        first = first[first + gap <= last]
    return np.unique(np.concatenate(pairs), axis=0)


def _neighbours(pairs: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """How many pairs end where each begins, and begin where it ends: 1 beyond the ends. Both (p,)."""
    begun, ended = (np.bincount(column, minlength=count) for column in pairs.T)
    return np.maximum(ended[pairs[:, 0]], pairs[:, 0] == 0), np.maximum(begun[pairs[:, 1]], pairs[:, 1] == count - 1)


def _links(pairs: np.ndarray, count: int) -> np.ndarray:
    """Every pair with all pairs that end where it begins and begin where it ends: (l, 4), -1 beyond the ends."""
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


def _shortest(pairs: np.ndarray, count: int) -> np.ndarray:
    """The fewest of the candidates that lead from the first to the last, pair by pair."""
    keys, back = [1] + [MANY] * (count - 1), [0] * count
    for first, second in pairs.tolist():
        if keys[first] + 1 < keys[second]:
            keys[second], back[second] = keys[first] + 1, first
    way = [count - 1]
    while way[-1]:
        way.append(back[way[-1]])
    return np.array(way[::-1])


def _shortest_of_four(links: np.ndarray) -> np.ndarray:
    """The same by links of four, of which successive ones have three keys in common."""
    keys: dict[tuple[int, int, int], int] = {}
    back: dict[tuple[int, int, int], tuple[int, int, int]] = {}
    fewest, last = MANY, (-1, 0, 0)
    for before, first, second, after in links[np.argsort(links[:, 1], kind="stable")].tolist():
        here = (before, first, second)
        count = 2 if before < 0 else keys.get(here, MANY)
        if after < 0:
            if count < fewest:
                fewest, last = count, here
        elif count + 1 < keys.get((first, second, after), MANY):
            keys[first, second, after], back[first, second, after] = count + 1, here
    way = [last[2], last[1]]
    while last[0] >= 0:
        way.append(last[0])
        last = back[last]
    return np.array(way[::-1])
