"""What of a clip needs no search for keys: channels that are constant, stepped, or depend on nothing else.

Channels share key times where that saves bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .errors import World
from .tracks import CUBICSPLINE, LINEAR, ROTATION, SCALE, STEP, WEIGHTS, Clip, Track

TIME = 4
"""Bytes of a key's time."""

AT_ONCE = 2**13
"""Samples that are looked at in one go."""

NOISE = 0.01
"""A channel that changes by less than this share of the tolerance is constant."""

OF_SCALES = 0.1
"""The share of the tolerance that a channel of scales may take."""

WITHIN_WEIGHTS = 0.005
"""How far off weights of morph targets may be: half a percent of the whole target."""

WIDE = np.radians(15.0)
"""A gap between samples in which a node turns farther is halved: what hangs on it runs in a bow."""

BOW = 0.02
"""The share of the tolerance by which a spline may leave the line between two samples."""

HALVINGS = 8


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


def moments(world: World, clip: Clip, tolerance: float) -> np.ndarray:
    """Return the moments between which all runs evenly, as close as turns and splines need it, shape (m,), rising."""
    moved = [track for track in clip.tracks if track.path != WEIGHTS and not track.is_constant]
    different = {id(track.times): track.times for track in moved}
    times = np.unique(np.concatenate([world.times, *different.values()]))
    smooth = [track for track in moved if track.interpolation != STEP]
    curved = any(track.interpolation == CUBICSPLINE for track in smooth)
    reaches = replace(world, times=times).reaches if curved else None
    for _ in range(HALVINGS):
        halved = np.zeros(len(times) - 1, dtype=bool)
        for track in smooth:
            values = track.at(times)
            if track.path == ROTATION:
                cosines = np.einsum("ij,ij->i", values[1:], values[:-1])
                # A spline that passes near 0 comes out on the other side: nearly a whole turn in no time.
                halved |= (cosines if track.interpolation == CUBICSPLINE else np.abs(cosines)) < np.cos(WIDE / 2)
            if track.interpolation == CUBICSPLINE and reaches is not None:
                reach = 1.0 if track.path not in (ROTATION, SCALE) else 2.0 * reaches[world.rows[track.node]]
                halved |= _bows(track, times, values) * reach > BOW * tolerance
        middles = ((times[:-1] + times[1:]) / 2)[halved].astype(np.float32).astype(np.float64)
        more = np.union1d(times, middles)
        if len(more) == len(times):
            break
        times = more
    return times


def settled(world: World, clip: Clip, tolerance: float) -> dict[tuple[int, str], Track | None]:
    """Return the tracks that need no search, and what takes their places: None where the node rests."""
    result: dict[tuple[int, str], Track | None] = {}
    for track in clip.tracks:
        target = track.node, track.path
        settling = _Settling(world, track, tolerance)
        if settling.rests:
            result[target] = None
        elif settling.is_constant:
            result[target] = replace(track, interpolation=LINEAR, times=world.times[:1], values=settling.values[:1])
        elif track.interpolation == STEP:
            # The first, and those that bring another value.
            keys = np.flatnonzero(np.append(True, np.any(track.points[1:] != track.points[:-1], axis=1)))
            result[target] = replace(track, times=track.times[keys], values=track.points[keys])
        elif track.path in (SCALE, WEIGHTS):
            keys = on_lines(settling.times, settling.values, settling.within)
            times, values = settling.times[keys], settling.values[keys]
            result[target] = replace(track, interpolation=LINEAR, times=times, values=values)
    return result


class _Settling:
    """A track, and how far it moves what hangs on its node, at the moments between which it runs evenly."""

    def __init__(self, world: World, track: Track, tolerance: float) -> None:
        self.world, self.track, self.tolerance = world, track, tolerance
        curved = track.interpolation == CUBICSPLINE
        self.times = np.union1d(world.times, track.times) if curved else track.times
        self.values = track.at(self.times)
        self.row = world.rows.get(track.node, -1)

    @property
    def rests(self) -> bool:
        """Whether the node is all the time as it would be without the track."""
        rest = self.world.nodes.rest_of(self.track.node, self.track.path)
        if self.track.path == WEIGHTS and not len(rest):
            rest = np.zeros(self.values.shape[1])
        return len(rest) == self.values.shape[1] and self._is_at(rest)

    @property
    def is_constant(self) -> bool:
        return self._is_at(self.values[0])

    @property
    def within(self) -> float:
        """How far off the numbers of scales or weights may be."""
        if self.track.path == WEIGHTS:
            return WITHIN_WEIGHTS
        return OF_SCALES * self.tolerance / self.world.reaches[self.row] * float(np.abs(self.values).max())

    def _is_at(self, value: np.ndarray) -> bool:
        if self.track.path == WEIGHTS:
            return bool(np.all(self.values == value))
        return float(self._displacements(value).max()) <= NOISE * self.tolerance

    def _displacements(self, value: np.ndarray) -> np.ndarray:
        """How far what hangs on the node is moved at most from where one value has it, shape (m,)."""
        values, reach = self.values, self.world.reaches[self.row]
        if self.track.path == ROTATION:
            # Of both signs, for noise is smaller than what is left of 1 less a cosine.
            return 2.0 * reach * np.minimum(*(np.linalg.norm(values + sign * value, axis=1) for sign in (1.0, -1.0)))
        if self.track.path == SCALE:
            return reach * np.abs(values / np.where(value == 0.0, 1.0, value) - 1.0).max(axis=1)
        return np.linalg.norm(values - value, axis=1) * self.world.longest_above[self.row]


def _bows(track: Track, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """How far a spline leaves the straight way between its values at moments (m,), in each gap, shape (m - 1,)."""
    result = np.zeros(len(times) - 1)
    for share in (0.25, 0.5, 0.75):
        line = (1.0 - share) * values[:-1] + share * values[1:]
        if track.path == ROTATION:
            line /= np.linalg.norm(line, axis=1, keepdims=True)
        there = track.at((1.0 - share) * times[:-1] + share * times[1:])
        result = np.maximum(result, np.linalg.norm(there - line, axis=1))
    return result
