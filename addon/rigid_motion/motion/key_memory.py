"""What is known of segments: found again by the samples that their keys are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)
"""Spreads segments over the places that they are remembered in: 2^64 over the golden ratio."""


class Memory:
    """Numbers of segments, each in a place that its samples make; another one for that place replaces it."""

    def __init__(self, most: int, columns: int) -> None:
        bits = max(1, (most - 1).bit_length())
        self._shift = np.uint64(64 - bits)
        self._numbers, self._found = np.zeros(2**bits, dtype=np.uint64), np.empty((2**bits, columns))
        self._last = np.empty(2**bits, dtype=np.int64)

    def find(self, rows: np.ndarray, samples: int, work_out: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return what there is for segments (s, keys), shape (s, columns), worked out where it is not remembered.

        `samples` is how many there are: a segment is the number that has its samples for digits. Where that has more
        than 64 bits, another one with the same last bits is none that anybody will ever see.
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
            # Of those for one place the last stays: others are worked out only where they are not the same.
            self._last[places] = order
            last = self._last[places]
            differs = numbers != numbers[last]
            stays = last == order
            needed = stays | differs
            of_needed = work_out(rows[new[needed]])
            result[new] = of_needed[(np.cumsum(needed) - 1)[np.where(differs, order, last)]]
            self._numbers[places[stays]], self._found[places[stays]] = numbers[stays], of_needed[stays[needed]]
        return result
