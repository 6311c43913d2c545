"""Cycles modifiers: which frame of the keys is shown on a frame, and where the copies of keys are."""

from __future__ import annotations

import numpy as np

from .keys import Keys

MAX_COPIES = 2**22
"""The largest number of key times that `cyclic_times` returns."""


class TooManyRounds(ValueError):
    """Cycles that are so short, and so many, that there would be millions of keys."""

    def __init__(self, rounds: float, period: float) -> None:
        super().__init__(rounds, period)
        self.rounds, self.period = rounds, period


def cycled(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times folded back into the range of the keys by the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve. Without cycles times stay what they are.
    times : array, shape (m,)
        Frames.

    Returns
    -------
    folded : array, shape (m,)
        In the range of the keys, or as they were where no cycle reaches.
    backwards : array of bool, shape (m,)
        Whether time runs backwards there.
    """
    with np.errstate(all="ignore"):
        folded, backwards, _ = fold(keys, np.asarray(times))
    return folded, backwards


def cyclic_times(keys: Keys, times: np.ndarray, first: float, last: float) -> np.ndarray:
    """Return key times and their copies in the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve whose cycles count. Times outside the range of its keys are not copied.
    times : array, shape (k,)
        Key times, of this curve or of several.
    first, last : float
        Frames that the times returned are between, both included.

    Returns
    -------
    array, shape (c,)
        Rising, each time once.

    Raises
    ------
    TooManyRounds
        Where there would be more than `MAX_COPIES`.
    """
    times = np.asarray(times, dtype=np.float64)
    copies = [times]
    if keys.cycles is not None and len(keys.times):
        begin, end = keys.times[[0, -1]].tolist()
        period = end - begin
        inside = times[(times >= begin) & (times <= end)]
        for mode, count, length, side in (
            (keys.cycles.before, keys.cycles.before_count, begin - first, -1.0),
            (keys.cycles.after, keys.cycles.after_count, last - end, 1.0),
        ):
            if mode == "NONE" or not (0.0 < period < np.inf and length > 0.0) or count < 0:
                continue
            rounds = np.ceil(length / period)
            rounds = min(rounds, count) if count else rounds
            if rounds * len(inside) > MAX_COPIES:
                raise TooManyRounds(rounds, period)
            number = np.arange(1.0, rounds + 1.0)[:, None]
            mirrored = (number % 2 == 1) & (mode == "MIRROR")
            copies.append((np.where(mirrored, begin + end - inside, inside) + side * number * period).ravel())
    copied = np.unique(np.concatenate(copies))
    return copied[(copied >= first) & (copied <= last)]


def fold(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times folded, whether they run backwards, and how many times the change from first to
    last key is to be added.

    All in single precision and in Blender's order of steps: it decides on which side of a key a frame falls.
    """
    folded = times.astype(np.float32)
    backwards, rounds = np.zeros(times.shape, dtype=bool), np.zeros(times.shape, np.float32)
    frames = keys.points[0, :, 0]
    if keys.cycles is None or not len(frames) or frames[0] == frames[-1]:
        return folded.astype(np.float64), backwards, rounds
    begin, end = frames[0], frames[-1]
    period = end - begin
    for mode, count, outside, side in (
        (keys.cycles.before, keys.cycles.before_count, folded < begin, -1),
        (keys.cycles.after, keys.cycles.after_count, folded > end, 1),
    ):
        if mode == "NONE":
            continue
        near, far = (begin, end) if side < 0 else (end, begin)
        distance = folded[outside] - near
        cycle = side * distance / period
        reached = (cycle <= count) | (count == 0)
        at = np.flatnonzero(outside)[reached]
        distance, cycle = distance[reached], cycle[reached]
        remainder = np.fmod(distance, period)
        odd = (np.trunc(cycle) % 2 == 1) & (mode == "MIRROR")
        reverse = (np.trunc(cycle.astype(np.float64) + 1.0) % 2 == 1) & (mode == "MIRROR")
        time = np.where(reverse, near - remainder, begin + remainder)
        time = np.where(remainder == 0.0, np.where(odd, far, near), time)
        folded[at] = np.where(time < begin, time + period, time)
        backwards[at] = reverse
        if mode == "REPEAT_OFFSET":
            away_from_keys = np.floor if side < 0 else np.ceil
            rounds[at] = away_from_keys(distance / period)
    return folded.astype(np.float64), backwards, rounds
