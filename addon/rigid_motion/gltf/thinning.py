"""Fewer keys of channels that depend on nothing else, and key times that channels share where that saves bytes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

TIME = 4
"""Bytes of a key's time."""


def on_lines(times: np.ndarray, values: np.ndarray, within: float) -> np.ndarray:
    """The keys that straight lines need to stay within a distance of values (n, width), rising, shape (k,).

    From each key the line goes as far as it can. The distance is the largest of any column.
    """
    keys, last = [0], len(times) - 1
    while keys[-1] < last:
        first, reach = keys[-1], 1
        while first + reach < last and _is_line(times, values, first, min(first + 2 * reach, last), within):
            reach *= 2
        low, high = first + reach, min(first + 2 * reach, last)
        while low < high:
            middle = (low + high + 1) // 2
            if _is_line(times, values, first, middle, within):
                low = middle
            else:
                high = middle - 1
        keys.append(min(low, last))
    return np.array(keys)


def without_repeats(values: np.ndarray) -> np.ndarray:
    """The keys of a stepped channel (n, width) that bring another value, and the first; rising, shape (k,)."""
    return np.flatnonzero(np.append(True, np.any(values[1:] != values[:-1], axis=1)))


def shared_times(keys: Sequence[np.ndarray], widths: Sequence[int], samples: int) -> list[np.ndarray]:
    """Keys of channels, with more of them where channels that then have the same need fewer bytes for their times.

    Parameters
    ----------
    keys : sequence of array of int
        Which of so many samples are keys of each channel.
    widths : sequence of int
        The bytes of a key's value.
    samples : int

    Returns
    -------
    list of array of int
        Rising; those of channels that share are the same array.
    """
    if not keys:
        return []
    marked = np.zeros((len(keys), samples), dtype=np.float32)
    for row, own in zip(marked, keys, strict=True):
        row[own] = 1.0
    groups = [[channel] for channel in range(len(keys))]
    counts, bytes_each = marked.sum(axis=1), np.array(widths, dtype=np.float64)
    both = marked @ marked.T
    saved = _saved(both, counts, bytes_each)
    while True:
        first, second = np.unravel_index(int(np.argmax(saved)), saved.shape)
        if not saved[first, second] > 0.0:
            break
        groups[first] += groups[second]
        groups[second] = []
        marked[first] = np.maximum(marked[first], marked[second])
        marked[second] = 0.0
        counts[first], counts[second] = marked[first].sum(), 0.0
        bytes_each[first] += bytes_each[second]
        both[first] = both[:, first] = marked @ marked[first]
        both[second] = both[:, second] = 0.0
        saved[second] = saved[:, second] = -1.0
        row = _saved(both[first][None], counts[first : first + 1], bytes_each[first : first + 1], counts, bytes_each)[0]
        row[[not group for group in groups]] = -1.0
        row[first] = -1.0
        saved[first] = saved[:, first] = row
    found: list[np.ndarray] = [np.empty(0)] * len(keys)
    for row, group in zip(marked, groups, strict=True):
        own = np.flatnonzero(row)
        for channel in group:
            found[channel] = own
    return found


def _saved(
    both: np.ndarray,
    counts: np.ndarray,
    widths: np.ndarray,
    others: np.ndarray | None = None,
    other_widths: np.ndarray | None = None,
) -> np.ndarray:
    """The bytes that each pair of channels needs less with all keys of both, given how many keys are in both."""
    square = others is None
    others, other_widths = (counts, widths) if others is None else (others, other_widths)
    saved = TIME * both - widths[:, None] * (others[None] - both) - other_widths[None] * (counts[:, None] - both)
    if square:
        np.fill_diagonal(saved, -1.0)
    return saved


def _is_line(times: np.ndarray, values: np.ndarray, first: int, last: int, within: float) -> bool:
    share = ((times[first : last + 1] - times[first]) / (times[last] - times[first]))[:, None]
    line = (1.0 - share) * values[first] + share * values[last]
    return bool(np.abs(line - values[first : last + 1]).max() <= within)
