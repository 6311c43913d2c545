"""Channels of a clip that need no key search: constant, stepped, or reducible independently of others.

Also finds channels that should share key times to save bytes.
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
"""Samples processed in one go."""

MAX_CONSTANT_RATIO = 0.01
"""A channel is constant if its effect stays below this fraction of the tolerance."""

OF_CHANNELS = 0.1
"""Fraction of the tolerance that a channel of scales or weights may use."""

WITHIN_WEIGHTS = 0.005
"""Largest error of morph target weights: half a percent of the whole target."""

MAX_GAP_TURN_RAD = np.radians(15.0)
"""Gaps between samples in which a node turns farther are halved: its descendants move on an arc."""

MAX_BOW_RATIO = 0.02
"""Largest distance of a spline from the line between two samples, as a fraction of the tolerance."""

MAX_GAP_HALVINGS = 8

MIN_SAMPLES_PER_SPLINE_KEY = 20
"""Samples per key of a spline: a spline that needs more takes fewer bytes as a spline than as lines."""

Measure = Callable[[np.ndarray], np.ndarray]
"""Function of value differences (m, width): returns the fraction of the allowed error, shape (m,)."""


def on_lines(times: np.ndarray, values: np.ndarray, measure: Measure, within: float) -> np.ndarray:
    """Return the rising keys (k,) with which straight lines stay within a distance of values (n, width).

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
    """Return the keys of channels, with keys added where sharing times with another channel saves bytes.

    Parameters
    ----------
    keys : sequence of array of int
        Key samples of each channel.
    widths : sequence of int
        Bytes of a key's value, for each channel.
    samples : int
        Number of samples.

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
        """Return how many keys each channel has in common with the rows."""
        result = np.zeros((len(marked), *rows.shape[:-1]))
        for first in range(0, samples, AT_ONCE):
            some = slice(first, first + AT_ONCE)
            result += marked[:, some].astype(np.float32) @ rows[..., some].astype(np.float32).T
        return result

    both = in_common(marked)

    def saved(first: int) -> np.ndarray:
        """Return the bytes saved by merging each other group with this one."""
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
    """A track with moments between which it runs evenly, and the effect of differences in its values.

    Parameters
    ----------
    world : World
        With moments at least at all keys.
    track : Track
    tolerance : float
    """

    def __init__(self, world: World, track: Track, tolerance: float) -> None:
        self.world, self.track, self.tolerance = world, track, tolerance
        self.row = world.rows.get(track.node, -1)
        self.is_curved = track.interpolation == CUBICSPLINE
        self.times, self.stays = track.times, False
        """Whether the track stays a spline."""
        for _ in range(MAX_GAP_HALVINGS if track.interpolation != STEP else 0):
            halved = self._wide_gaps(track.at(self.times))
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
        """The values at these moments, shape (m, width); computed each time, as all channels together are large."""
        return self.track.at(self.times)

    def _wide_gaps(self, values: np.ndarray) -> np.ndarray:
        """Return which gaps between the moments are too wide."""
        result = np.zeros(len(self.times) - 1, dtype=bool)
        if self.track.path == ROTATION:
            cosines = np.einsum("ij,ij->i", values[1:], values[:-1])
            # A spline that passes near 0 emerges with the opposite sign: nearly a whole turn in no time.
            result = (cosines if self.is_curved else np.abs(cosines)) < np.cos(MAX_GAP_TURN_RAD / 2)
        for share in (0.25, 0.5, 0.75) if self.is_curved else ():
            line = (1.0 - share) * values[:-1] + share * values[1:]
            if self.track.path == ROTATION:
                line /= np.linalg.norm(line, axis=1, keepdims=True)
            there = self.track.at((1.0 - share) * self.times[:-1] + share * self.times[1:])
            result |= self.measured(there - line) > MAX_BOW_RATIO
        return result

    def is_at(self, value: np.ndarray, values: np.ndarray) -> bool:
        """Whether these values (m, width) of the track equal `value`, apart from noise."""
        if self.stays or len(value) != values.shape[1]:
            return False
        off = self.measured(values - value)
        if self.track.path == ROTATION:
            # Try both signs: the noise is smaller than the rounding of 1 minus a cosine.
            off = np.minimum(off, self.measured(values + value))
        return float(off.max()) <= MAX_CONSTANT_RATIO

    def measured(self, differences: np.ndarray) -> np.ndarray:
        """Return how far differences (m, width) move anything below the node, as a fraction of the tolerance."""
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
        """Largest world displacement by a weight of 1 of each morph target, shape (width,)."""
        node, morphs = self.track.node, self.world.seen.morphs
        return morphs[node].deltas * self.world.morph_scale(node) if node in morphs else np.zeros(self.values.shape[1])

    @cached_property
    def _largest(self) -> np.ndarray:
        """Largest magnitude of each scale component, shape (3,)."""
        result = np.abs(self.track.points).max(axis=0)
        return np.where(result > 0.0, result, 1.0)


def settled(channels: Iterable[SettledChannel], needed: Container[Target]) -> dict[Target, Track | None]:
    """Return the replacements of tracks that need no search; None for a channel that can be removed.

    A channel is removed if its node stays at rest and the channel is not needed.
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
            # The first key, and keys with a new value.
            keys = np.flatnonzero(np.append(True, np.any(track.points[1:] != track.points[:-1], axis=1)))
            result[target] = replace(track, times=track.times[keys], values=track.points[keys])
        elif track.path in (SCALE, WEIGHTS):
            keys = on_lines(channel.times, values, channel.measured, OF_CHANNELS)
            lines = replace(track, interpolation=LINEAR, times=channel.times[keys], values=values[keys])
            result[target] = track.whole if channel.is_curved and lines.size >= track.size else lines
    return result
