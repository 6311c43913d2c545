"""Errors of motor splines between keys, for the key search: with little work for each segment and sample.

A segment of `motor_spline` is the screw from key to key, bent by the two neighbouring keys (`curves`). Relative to a
sample of the recording, the pose on the screw depends only on the two keys of the segment. It is worked out once and
cached for all neighbours that are tried with these keys. Only the bend is left to compute for each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import twists
from .curves import twist_shares
from .key_memory import Memory
from .measures import largest_displacement
from .quaternions import cross
from .segments import MAX_SAME_POSE_CHANGE, in_one_place

if TYPE_CHECKING:
    from .key_costs import SampleTracks

MAX_REMEMBERED_SAMPLES = 2**18
"""Samples between two keys in the cache at most, so that long recordings do not fill the memory."""

REMEMBERED_EACH = 200
"""The same per sample of a shorter recording."""

MAX_KNOWN_PAIRS = 2**14
"""Pairs of keys in the cache at most."""


class SplineErrors:
    """The errors of `motor_spline` between keys of a recording (n,) without scales, in tolerances."""

    def __init__(self, recording: SampleTracks) -> None:
        self._recording, self._times, self._rows = recording, recording.times, recording.truth.rows
        # For two keys: the twist from one to the other and whether nothing moves there, then the poses in between.
        self._blocks = np.empty((7, min(MAX_REMEMBERED_SAMPLES, REMEMBERED_EACH * len(self._times))))
        self._forget()

    def errors(self, rows: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return samples (m,) and their errors (m,) in segments (s, 4), given the number of samples in each (s,)."""
        before, first, second, after = rows.T
        blocks = self._blocks_of(rows[:, 1:3], counts)
        offsets = np.cumsum(counts) - counts
        numbers = np.arange(counts.sum())
        samples = numbers + np.repeat(first + 1 - offsets, counts)
        there = self._blocks.take(numbers + np.repeat(blocks + 1 - offsets, counts), axis=1)
        bends = self._bends(before, first, second, after, self._blocks.take(blocks, axis=1))
        done = self._progress(samples, np.repeat(first, counts), np.repeat(second, counts))
        left = 1.0 - done
        both = done * left
        added = np.einsum("kbm,bm->km", bends.repeat(counts, axis=2), np.stack((both * left, -both * done)))
        turns, offs = twists.exponential(added)
        offs += there[4:]
        turned = cross(turns[1:], there[1:4])
        turned += turns[0] * there[1:4]
        turned += there[0] * turns[1:]
        radius = self._recording.radius
        errors = largest_displacement(offs, turned, radius[samples] if radius.ndim else radius)
        return samples, self._recording.in_tolerances(errors, samples)

    def _bends(
        self, before: np.ndarray, first: np.ndarray, second: np.ndarray, after: np.ndarray, own: np.ndarray
    ) -> np.ndarray:
        """Return what is added to the twists (7, s) at both ends of segments, shape (6, 2, s), as in `curves`."""
        # At the ends, the motion of the segment continues.
        starts, stops = before < 0, after < 0
        begins = np.stack((np.where(starts, first, before), np.where(stops, first, second)))
        ends = np.stack((np.where(starts, second, first), np.where(stops, second, after)))
        beside = self._between(begins.ravel(), ends.ravel()).reshape(7, 2, -1)
        duration, durations = self._times[second] - self._times[first], self._times[ends] - self._times[begins]
        shares = twist_shares(np.stack((durations[0], duration)), np.stack((duration, durations[1])))
        shares[1] = 1.0 - shares[1]
        rates, own_rates = beside[:6] / durations, (own[:6] / duration)[:, None]
        twists_there = shares * rates + (1.0 - shares) * own_rates
        if own[6].any() or beside[6].any():
            twists_there *= (beside[6] == 0.0) & (own[6] == 0.0)
        bends = twists_there * duration - own[:6, None]
        bends *= own[6] == 0.0
        return bends

    def _between(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return twists between pairs of samples (p,), and whether nothing moves there as in `Segments`: (7, p)."""
        begin, end = self._rows.take(first, axis=1), self._rows.take(second, axis=1)
        result = np.zeros((7, len(first)))
        result[:6] = twists.logarithm(*_seen_from(begin, end))
        rests = in_one_place(begin[:3], end[:3])
        if rests.any():
            result[6] = rests & (np.einsum("kp,kp->p", result[:3], result[:3]) < MAX_SAME_POSE_CHANGE**2)
        return result

    def _progress(self, samples: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return how far samples (m,) are from one key to the next, from 0 to 1."""
        start = self._times[first]
        return (self._times[samples] - start) / (self._times[second] - start)

    def _blocks_of(self, pairs: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Return where the blocks of pairs of keys (s, 2) begin, (s,), given the number of samples between them."""
        needed = int(counts.sum()) + len(pairs)
        if self._used + needed > self._blocks.shape[1]:
            self._forget()
            if needed > self._blocks.shape[1]:
                self._blocks = np.empty((7, needed))
        return self._known.find(pairs, len(self._times), self._work_out)[:, 0].astype(np.int64)

    def _forget(self) -> None:
        self._known, self._used = Memory(MAX_KNOWN_PAIRS, 1), 0

    def _work_out(self, pairs: np.ndarray) -> np.ndarray:
        """Fill the blocks of pairs of keys (p, 2), and return where they begin, (p, 1).

        Poses are relative to the recording: the turn, and the displacement in the axes of the turned body.
        """
        first, second = pairs.T
        counts = second - first - 1
        begins = self._used + np.cumsum(counts + 1) - counts - 1
        own = self._blocks[:, begins] = self._between(first, second)
        offsets = np.cumsum(counts) - counts
        numbers = np.arange(counts.sum())
        samples = numbers + np.repeat(first + 1 - offsets, counts)
        keys = np.repeat(first, counts)
        done = self._progress(samples, keys, np.repeat(second, counts))
        turns, ways = twists.exponential(done * own[:6].repeat(counts, axis=1))
        true_turns, true_ways = _seen_from(self._rows.take(keys, axis=1), self._rows.take(samples, axis=1))
        block = np.empty((7, len(samples)))
        block[:4] = _turned_back(true_turns, turns)
        block[4:] = _carried_back(turns, ways - true_ways)
        self._blocks[:, numbers + np.repeat(begins + 1 - offsets, counts)] = block
        self._used += len(numbers) + len(pairs)
        return begins[:, None].astype(np.float64)


def _seen_from(begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the turns (4, m) and displacements (3, m) between poses (7, m), in the axes of the first."""
    return _turned_back(begin[3:], end[3:]), _carried_back(begin[3:], end[:3] - begin[:3])


def _turned_back(turns: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Return conjugate(turns) times quaternions, components first."""
    result = np.empty(quaternions.shape)
    np.einsum("km,km->m", turns, quaternions, out=result[0])
    result[1:] = turns[0] * quaternions[1:]
    result[1:] -= quaternions[0] * turns[1:]
    result[1:] -= cross(turns[1:], quaternions[1:])
    return result


def _carried_back(turns: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return displacements (3, m) in the axes of turned bodies (4, m)."""
    across = cross(ways, turns[1:])
    across *= 2.0
    result = cross(across, turns[1:])
    result += turns[0] * across
    result += ways
    return result
