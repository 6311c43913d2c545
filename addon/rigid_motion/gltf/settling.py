"""What of a clip needs no search for keys: channels that are constant, stepped, or depend on nothing else.

Channels share key times where that saves bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from .errors import World
from .tracks import CUBICSPLINE, LINEAR, ROTATION, SCALE, STEP, TRANSLATION, WEIGHTS, Target, Track

TIME_BYTES = 4
"""Bytes of a key's time."""

AT_ONCE = 2**13
"""Samples that are looked at in one go."""

MAX_CONSTANT_RATIO = 0.01
"""A channel that changes by less than this share of the tolerance is constant."""

OF_CHANNELS = 0.1
"""The share of the tolerance that a channel of scales or weights may take."""

WITHIN_WEIGHTS = 0.005
"""How far off weights of morph targets may be: half a percent of the whole target."""

MAX_GAP_TURN_RAD = np.radians(15.0)
"""A gap between samples in which a node turns farther is halved: what hangs on it runs in a bow."""

MAX_BOW_RATIO = 0.02
"""The share of the tolerance by which a spline may leave the line between two samples."""

MAX_GAP_HALVINGS = 8

MIN_SAMPLES_PER_SPLINE_KEY = 20
"""Samples for each key of a spline: one that needs more takes fewer bytes as a spline than as lines."""

Measure = Callable[[np.ndarray], np.ndarray]
"""From differences of values (m, width) to how much of what is allowed they are, shape (m,)."""


def on_lines(times: np.ndarray, values: np.ndarray, measure: Measure, within: float) -> np.ndarray:
    """Return the keys that straight lines need to stay within a distance of values (n, width), rising, shape (k,).

    From each key the line goes as far as it can.
    """
    keys, last = [0], len(times) - 1
    while keys[-1] < last:
        first, reach = keys[-1], 1

        def is_line(end: int, first: int = first) -> bool:
            share = ((times[first : end + 1] - times[first]) / (times[end] - times[first]))[:, None]
            line = (1.0 - share) * values[first] + share * values[end]
            return bool(measure(line - values[first : end + 1]).max() <= within)

        while first + reach < last and is_line(min(first + 2 * reach, last)):
            reach *= 2
        low, high = first + reach, min(first + 2 * reach, last)
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if is_line(middle) else (low, middle - 1)
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
        result = TIME_BYTES * both[first] - sizes[first] * needed_by_first - sizes * needed_by_others
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


class SettledChannel:
    """A track, and how much of what is allowed differences of its values are, at moments between which it runs evenly.

    Parameters
    ----------
    world : World
        Whose moments are those of keys at least.
    track : Track
    tolerance : float
    """

    def __init__(self, world: World, track: Track, tolerance: float) -> None:
        self.world, self.track, self.tolerance = world, track, tolerance
        self.row = world.rows.get(track.node, -1)
        self.is_curved = track.interpolation == CUBICSPLINE
        self.times, self.stays = track.times, False
        """Whether it stays a spline."""
        for _ in range(MAX_GAP_HALVINGS if track.interpolation != STEP else 0):
            halved = self._halved(track.at(self.times))
            middles = ((self.times[:-1] + self.times[1:]) / 2)[halved].astype(np.float32).astype(np.float64)
            more = np.union1d(self.times, middles)
            if len(more) == len(self.times):
                break
            self.times, self.stays = more, self.is_curved and len(more) > MIN_SAMPLES_PER_SPLINE_KEY * len(track.times)
            if self.stays:
                self.times = track.times
                break

    @property
    def values(self) -> np.ndarray:
        """What it shows at these moments, shape (m, width); worked out anew, for that of all channels is much."""
        return self.track.at(self.times)

    def _halved(self, values: np.ndarray) -> np.ndarray:
        """Which gaps between the moments are too wide."""
        result = np.zeros(len(self.times) - 1, dtype=bool)
        if self.track.path == ROTATION:
            cosines = np.einsum("ij,ij->i", values[1:], values[:-1])
            # A spline that passes near 0 comes out on the other side: nearly a whole turn in no time.
            result = (cosines if self.is_curved else np.abs(cosines)) < np.cos(MAX_GAP_TURN_RAD / 2)
        for share in (0.25, 0.5, 0.75) if self.is_curved else ():
            line = (1.0 - share) * values[:-1] + share * values[1:]
            if self.track.path == ROTATION:
                line /= np.linalg.norm(line, axis=1, keepdims=True)
            there = self.track.at((1.0 - share) * self.times[:-1] + share * self.times[1:])
            result |= self.measured(there - line) > MAX_BOW_RATIO
        return result

    def is_at(self, value: np.ndarray, values: np.ndarray) -> bool:
        """Whether these of its values (m, width) are one value, but for noise."""
        if self.stays or len(value) != values.shape[1]:
            return False
        off = self.measured(values - value)
        if self.track.path == ROTATION:
            # Of both signs, for noise is smaller than what is left of 1 less a cosine.
            off = np.minimum(off, self.measured(values + value))
        return float(off.max()) <= MAX_CONSTANT_RATIO

    def measured(self, differences: np.ndarray) -> np.ndarray:
        """How far what the node carries, and what hangs on it, is moved by differences (m, width), of the tolerance."""
        off, world = np.abs(differences), self.world
        if self.track.path == WEIGHTS:
            return np.maximum(off @ self._displaced / self.tolerance, OF_CHANNELS / WITHIN_WEIGHTS * off.max(axis=1))
        if self.track.path == TRANSLATION:
            return np.linalg.norm(off, axis=1) * world.longest_above[self.row] / self.tolerance
        reach = world.reaches[self.row] / self.tolerance
        if self.track.path == ROTATION:
            return 2.0 * reach * np.linalg.norm(off, axis=1)
        return reach * (off / self._largest).max(axis=1)

    @cached_property
    def _displaced(self) -> np.ndarray:
        """How far a weight of 1 of each morph target moves anything in the world, at most, shape (width,)."""
        node, morphs = self.track.node, self.world.seen.morphs
        return morphs[node].deltas * self.world.morph_scale(node) if node in morphs else np.zeros(self.values.shape[1])

    @cached_property
    def _largest(self) -> np.ndarray:
        """How large each of the scales gets, shape (3,)."""
        result = np.abs(self.track.points).max(axis=0)
        return np.where(result > 0.0, result, 1.0)


def settled(channels: Iterable[SettledChannel], needed: Container[Target]) -> dict[Target, Track | None]:
    """Return the tracks that need no search, and what takes their places: None where the node rests.

    Those that are needed keep a key there as well.
    """
    result: dict[Target, Track | None] = {}
    for channel in channels:
        track, values = channel.track, channel.values
        target = track.node, track.path
        if target not in needed and channel.is_at(channel.world.nodes.rest_of(*target), values):
            result[target] = None
        elif channel.is_at(values[0], values):
            result[target] = replace(track, interpolation=LINEAR, times=channel.times[[0]], values=values[[0]])
        elif channel.stays:
            result[target] = track.whole
        elif track.interpolation == STEP:
            # The first, and those that bring another value.
            keys = np.flatnonzero(np.append(True, np.any(track.points[1:] != track.points[:-1], axis=1)))
            result[target] = replace(track, times=track.times[keys], values=track.points[keys])
        elif track.path in (SCALE, WEIGHTS):
            keys = on_lines(channel.times, values, channel.measured, OF_CHANNELS)
            lines = replace(track, interpolation=LINEAR, times=channel.times[keys], values=values[keys])
            result[target] = track.whole if channel.is_curved and lines.size >= track.size else lines
    return result
