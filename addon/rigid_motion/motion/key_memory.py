"""A cache of results by segment, where the samples of a segment's keys identify it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)
"""Spreads segments over the slots of the cache: 2^64 over the golden ratio."""


class Memory:
    """Results of segments, each in a slot hashed from its samples; a later segment for the same slot replaces it."""

    def __init__(self, most: int, columns: int) -> None:
        bits = max(1, (most - 1).bit_length())
        self._shift = np.uint64(64 - bits)
        self._numbers, self._found = np.zeros(2**bits, dtype=np.uint64), np.empty((2**bits, columns))
        self._last = np.empty(2**bits, dtype=np.int64)

    def find(self, rows: np.ndarray, samples: int, work_out: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return the results for segments (s, keys), shape (s, columns), worked out if they are not in the cache.

        `samples` is the number of samples in the recording. It makes a segment one number, with samples for digits. If
        this takes more than 64 bits, segments with the same last bits are mistaken for one another, which never happens
        in practice.
        """
        numbers = np.zeros(len(rows), dtype=np.uint64)
        for column in range(rows.shape[1]):
            numbers *= np.uint64(samples + 1)
            numbers += (rows[:, column] + 1).astype(np.uint64)
        places = ((numbers * HASH_FACTOR) >> self._shift).astype(np.int64)
        result = self._found.take(places, axis=0)
        new = np.flatnonzero(self._numbers.take(places) != numbers)
        if len(new):
            numbers, places, order = numbers[new], places[new], np.arange(len(new))
            # The last segment for a slot stays in it. Others for that slot are worked out only if they differ from it.
            self._last[places] = order
            last = self._last[places]
            differs = numbers != numbers[last]
            stays = last == order
            needed = stays | differs
            of_needed = work_out(rows[new[needed]])
            result[new] = of_needed[(np.cumsum(needed) - 1)[np.where(differs, order, last)]]
            self._numbers[places[stays]], self._found[places[stays]] = numbers[stays], of_needed[stays[needed]]
        return result
