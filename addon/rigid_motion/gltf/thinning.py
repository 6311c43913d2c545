"""Fewer keys of channels that depend on nothing else, and key times that channels share where that saves bytes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

TIME = 4
"""Bytes of a key's time."""

AT_ONCE = 2**13
"""Samples that are looked at in one go."""


def on_lines(times: np.ndarray, values: np.ndarray, within: float) -> np.ndarray:
    """Return the keys that straight lines need to stay within a distance of values (n, width), rising, shape (k,).

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
    """Return the keys of a stepped channel (n, width) that bring another value, and the first; rising, shape (k,)."""
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
        Rising.
    """
    marked = np.zeros((len(keys), samples), dtype=bool)
    for row, own in zip(marked, keys, strict=True):
        row[own] = True
    groups = [[channel] for channel in range(len(keys))]
    counts, sizes = marked.sum(axis=1), np.array(widths, dtype=np.float64)

    def in_common(rows: np.ndarray) -> np.ndarray:
        """How many keys each channel has that are among those of the rows."""
        result = np.zeros((len(marked), *rows.shape[:-1]))
        for first in range(0, samples, AT_ONCE):
            some = slice(first, first + AT_ONCE)
            result += marked[:, some].astype(np.float32) @ rows[..., some].astype(np.float32).T
        return result

    both = in_common(marked)

    def saved(first: int) -> np.ndarray:
        """Return the bytes that each other group needs less together with this one."""
        needed_by_first, needed_by_others = counts - both[first], counts[first] - both[first]
        result = TIME * both[first] - sizes[first] * needed_by_first - sizes * needed_by_others
        result[[number == first or not group for number, group in enumerate(groups)]] = -np.inf
        return result

    savings = np.array([saved(first) for first in range(len(groups))])
    while savings.size and savings.max() > 0.0:
        first, second = divmod(int(np.argmax(savings)), len(groups))
        groups[first] += groups[second]
        groups[second] = []
        marked[first] |= marked[second]
        counts[first], sizes[first] = marked[first].sum(), sizes[first] + sizes[second]
        both[first] = both[:, first] = in_common(marked[first])
        savings[second] = savings[:, second] = -np.inf
        savings[first] = savings[:, first] = saved(first)
    result = list(keys)
    for row, group in zip(marked, groups, strict=True):
        for channel in group:
            result[channel] = np.flatnonzero(row)
    return result


def _is_line(times: np.ndarray, values: np.ndarray, first: int, last: int, within: float) -> bool:
    share = ((times[first : last + 1] - times[first]) / (times[last] - times[first]))[:, None]
    line = (1.0 - share) * values[first] + share * values[last]
    return bool(np.abs(line - values[first : last + 1]).max() <= within)
