"""Spikes of a recording: a few samples that fit neither what is before them nor what is behind them, which fit each
other.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .poses import Poses
from .quaternions import conjugate, turned, turns_between
from .trembling import Trembling

MOST_ROWS = 6
"""The longest spike, in samples."""

EXPECTING_SAMPLES = 3
"""Samples on either side that say what is expected."""

MIN_SPIKE_ENDS_RATIO, MIN_SPIKE_SAMPLE_RATIO = 3.5, 2.0
"""By how many times of what is usual here a spike is off at its ends, and each sample of it."""

LONG_SPIKE_SAMPLES, LONG_SPIKE_FACTOR = 4, 1.4
"""So many samples have to be off by so many times as much: hits of a foot look like such, and are none."""

MIN_REPEAT_RATIO = 2.0
"""The same for what is a sample before it once more."""

MAX_REPEATED_RATIO = 0.1
"""The share of samples up to which those that repeat the one before are lost ones for certain where others tremble.
Where there are more, the recording is made of steps."""

STILL_FACTOR = 3.0
"""So many times as much where nothing trembles, as what is usual is not sure there."""

MAX_RETURN_RATIO = 3.0
"""By how many times of what is usual what is behind a spike is off from what was before it, at most."""

USUAL_RUNS = 12
"""Runs on either side that say what is usual: the livelier side does."""

USUAL_RATIO = 0.8
"""The share of a recording that is usual, where nothing trembles."""

MEDIAN_NORM = 1.53817
"""The norm below which half of normal vectors (3,) are."""


def outliers(times: np.ndarray, poses: Poses, noise: Trembling) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples (n,) are spikes, and which repeat one before them while the body moved on.

    Of a recording of times (n,) and poses (n,) that trembles so much. Longer spikes are looked for first. A hit is
    none: behind it another motion goes on.
    """
    found = np.zeros(len(times), dtype=bool)
    repeats = np.zeros(len(times), dtype=bool)
    same = poses.positions[1:] == poses.positions[:-1], poses.quaternions[1:] == poses.quaternions[:-1]
    repeats[1:] = same[0].all(axis=1) & same[1].all(axis=1)
    trembles = bool(noise.position or noise.rotation)
    for length in range(min(MOST_ROWS, len(times) - 4 * EXPECTING_SAMPLES), 0, -1):
        firsts = np.arange(EXPECTING_SAMPLES, len(times) - length - EXPECTING_SAMPLES + 1)
        over = np.zeros(len(firsts))
        apart = np.zeros(len(firsts))
        for surprise, each, across in _surprises(times, poses, noise, firsts, length):
            over = np.maximum(over, np.where(each > MIN_SPIKE_SAMPLE_RATIO, surprise, 0.0))
            apart = np.maximum(apart, across)
        is_repeated = repeats[firsts[:, None] + np.arange(length)].all(axis=1)
        enough = np.where(is_repeated, MIN_REPEAT_RATIO, MIN_SPIKE_ENDS_RATIO) * (1.0 if trembles else STILL_FACTOR)
        enough *= LONG_SPIKE_FACTOR if length >= LONG_SPIKE_SAMPLES else 1.0
        likely = np.flatnonzero((over > enough) & (apart < np.minimum(MAX_RETURN_RATIO, over)))
        for row in firsts[likely[np.argsort(-over[likely], kind="stable")]]:
            if not found[row - 1 : row + length + 1].any():
                found[row : row + length] = True
    lost = repeats & (trembles and 0.0 < repeats.mean() < MAX_REPEATED_RATIO)
    # What repeats for longer stands still.
    edges = np.flatnonzero(np.diff(lost, prepend=False, append=False))
    for first, end in zip(edges[0::2], edges[1::2], strict=True):
        lost[first:end] = end - first <= MOST_ROWS
    return found & ~repeats, (found & repeats) | lost


def _surprises(
    times: np.ndarray, poses: Poses, noise: Trembling, firsts: np.ndarray, length: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield for places and rotations how far each run that begins at `firsts` is off at its ends, how far each of its
    samples is, and how far what is behind it is off from what was before it: in times of what is usual there.
    """

    def samples(first: int, count: int) -> np.ndarray:
        return firsts[:, None] + np.arange(first, first + count)

    around = np.concatenate((samples(-2, 2), samples(length, 2)), axis=1)
    before, after = samples(-3, 3), samples(length, 3)
    # What is expected of which samples, by which.
    tried = (
        (around, samples(0, length)),
        (before, samples(0, 1)),
        (after, samples(length - 1, 1)),
        (before, samples(length, 2)),
        (after, samples(-2, 2)),
    )
    seen = conjugate(poses.quaternions)
    for position, smallest in ((True, noise.position), (False, noise.rotation)):
        offs = []
        for known, asked in tried:
            shares = _shares(times[known], times[asked])
            if position:
                values = poses.positions[known], poses.positions[asked]
            else:
                first, last = seen[known[:, 1]], seen[known[:, -2]]
                origin = turned(first, 0.5 * turns_between(first, last))[:, None]
                values = turns_between(seen[known], origin), turns_between(seen[asked], origin)
            off = np.linalg.norm(np.einsum("mrk,mkc->mrc", shares, values[0]) - values[1], axis=-1)
            # As if each came of one noisy number.
            off /= np.sqrt(1.0 + np.einsum("mrk,mrk->mr", shares, shares))
            most = off.max(axis=1)
            # Where nothing trembles all that is usual anywhere is.
            least = MEDIAN_NORM * smallest or np.quantile(most, USUAL_RATIO)
            offs.append(off / np.maximum(least, _usual(most, length + EXPECTING_SAMPLES))[:, None])
        inside, at_first, at_last, *gaps = offs
        surprise = np.minimum(np.minimum(at_first[:, 0], at_last[:, 0]), inside.max(axis=1))
        yield surprise, inside.min(axis=1), np.maximum(*(gap.max(axis=1) for gap in gaps))


def _shares(known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return by how much of values at known times (m, k) polynomials through them are made at others (m, r): (m, r, k).

    By Lagrange's formula.
    """
    count = known.shape[1]
    shares = np.empty((*asked.shape, count))
    for own in range(count):
        others = [other for other in range(count) if other != own]
        apart = known[:, None, [own]] - known[:, None, others]
        shares[..., own] = np.prod((asked[..., None] - known[:, None, others]) / apart, axis=-1)
    return shares


def _usual(values: np.ndarray, apart: int) -> np.ndarray:
    """Return what is usual at each of values (n,): the median of some so far before it or behind it, above 0."""
    count = len(values)
    width = min(USUAL_RUNS, count)
    medians = np.median(sliding_window_view(values, width), axis=-1)
    # Near an end, the side that is there counts.
    before, behind = np.arange(count) - apart - width + 1, np.arange(count) + apart
    sides = [
        np.where((at >= 0) & (at < len(medians)), medians[at.clip(0, len(medians) - 1)], 0.0) for at in (before, behind)
    ]
    return np.maximum(np.maximum(*sides), np.finfo(float).tiny)
