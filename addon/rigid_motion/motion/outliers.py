"""Spikes in recordings: a few samples that deviate from the samples before and after them, which fit each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .jitter import Jitter
from .poses import Poses
from .quaternions import conjugate, turned, turns_between

MOST_ROWS = 6
"""The longest spike, in samples."""

EXPECTING_SAMPLES = 3
"""Samples on either side that predict the samples of a spike."""

MIN_SPIKE_ENDS_RATIO, MIN_SPIKE_SAMPLE_RATIO = 3.5, 2.0
"""The least deviation of a spike at its ends, and of each of its samples, as a multiple of the usual deviation here."""

LONG_SPIKE_SAMPLES, LONG_SPIKE_FACTOR = 4, 1.4
"""Spikes of this many samples or more need deviations this many times as large, as foot impacts look like spikes."""

MIN_REPEAT_RATIO = 2.0
"""Replaces `MIN_SPIKE_ENDS_RATIO` for samples that repeat the sample before them."""

MAX_REPEATED_RATIO = 0.1
"""If fewer than this fraction of samples repeat their predecessor while others jitter, they are certainly lost samples.
Otherwise the recording consists of steps."""

STILL_FACTOR = 3.0
"""The required deviations are this many times as large without jitter, as the usual deviation is uncertain there."""

MAX_RETURN_RATIO = 3.0
"""How far the samples after a spike may deviate from those before it, as a multiple of the usual deviation."""

USUAL_RUNS = 12
"""Runs on either side that define the usual deviation; the side with the larger median counts."""

USUAL_RATIO = 0.8
"""The quantile of the deviations in a recording that is usual, if the recording has no jitter."""

MEDIAN_NORM = 1.53817
"""The median norm of standard normal vectors (3,)."""


def outliers(times: np.ndarray, poses: Poses, noise: Jitter) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples (n,) are spikes, and which repeat the sample before them while the body moved on.

    The recording has times (n,), poses (n,) and this noise. Longer spikes are searched for first. An impact is not a
    spike: the motion after it is a different one.
    """
    found = np.zeros(len(times), dtype=bool)
    repeats = np.zeros(len(times), dtype=bool)
    same = poses.positions[1:] == poses.positions[:-1], poses.quaternions[1:] == poses.quaternions[:-1]
    repeats[1:] = same[0].all(axis=1) & same[1].all(axis=1)
    has_jitter = bool(noise.position or noise.rotation)
    for length in range(min(MOST_ROWS, len(times) - 4 * EXPECTING_SAMPLES), 0, -1):
        firsts = np.arange(EXPECTING_SAMPLES, len(times) - length - EXPECTING_SAMPLES + 1)
        over = np.zeros(len(firsts))
        apart = np.zeros(len(firsts))
        for surprise, each, across in _run_deviations(times, poses, noise, firsts, length):
            over = np.maximum(over, np.where(each > MIN_SPIKE_SAMPLE_RATIO, surprise, 0.0))
            apart = np.maximum(apart, across)
        is_repeated = repeats[firsts[:, None] + np.arange(length)].all(axis=1)
        threshold = np.where(is_repeated, MIN_REPEAT_RATIO, MIN_SPIKE_ENDS_RATIO) * (
            1.0 if has_jitter else STILL_FACTOR
        )
        threshold *= LONG_SPIKE_FACTOR if length >= LONG_SPIKE_SAMPLES else 1.0
        likely = np.flatnonzero((over > threshold) & (apart < np.minimum(MAX_RETURN_RATIO, over)))
        for row in firsts[likely[np.argsort(-over[likely], kind="stable")]]:
            if not found[row - 1 : row + length + 1].any():
                found[row : row + length] = True
    lost = repeats & (has_jitter and 0.0 < repeats.mean() < MAX_REPEATED_RATIO)
    # A body whose samples repeat for longer stands still.
    edges = np.flatnonzero(np.diff(lost, prepend=False, append=False))
    for first, end in zip(edges[0::2], edges[1::2], strict=True):
        lost[first:end] = end - first <= MOST_ROWS
    return found & ~repeats, (found & repeats) | lost


def _run_deviations(
    times: np.ndarray, poses: Poses, noise: Jitter, firsts: np.ndarray, length: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield deviations of the runs of samples that begin at `firsts`, first of positions and then of rotations.

    The deviations are those of a run at its ends, of the least deviating sample of a run, and of the samples after a
    run from those before it. All are multiples of the usual deviation there.
    """

    def samples(first: int, count: int) -> np.ndarray:
        return firsts[:, None] + np.arange(first, first + count)

    around = np.concatenate((samples(-2, 2), samples(length, 2)), axis=1)
    before, after = samples(-3, 3), samples(length, 3)
    # Pairs: the samples that predict, and the samples that they predict.
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
            weights = _lagrange_weights(times[known], times[asked])
            if position:
                values = poses.positions[known], poses.positions[asked]
            else:
                first, last = seen[known[:, 1]], seen[known[:, -2]]
                origin = turned(first, 0.5 * turns_between(first, last))[:, None]
                values = turns_between(seen[known], origin), turns_between(seen[asked], origin)
            off = np.linalg.norm(np.einsum("mrk,mkc->mrc", weights, values[0]) - values[1], axis=-1)
            # Scale the noise to that of a single sample.
            off /= np.sqrt(1.0 + np.einsum("mrk,mrk->mr", weights, weights))
            most = off.max(axis=1)
            # Without jitter, the usual deviation of the whole recording is the minimum.
            least = MEDIAN_NORM * smallest or np.quantile(most, USUAL_RATIO)
            offs.append(off / np.maximum(least, _usual_sizes(most, length + EXPECTING_SAMPLES))[:, None])
        inside, at_first, at_last, *gaps = offs
        surprise = np.minimum(np.minimum(at_first[:, 0], at_last[:, 0]), inside.max(axis=1))
        yield surprise, inside.min(axis=1), np.maximum(*(gap.max(axis=1) for gap in gaps))


def _lagrange_weights(known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return weights (m, r, k) of values at known times (m, k) for their interpolating polynomials at times (m, r).

    They follow Lagrange's formula.
    """
    count = known.shape[1]
    weights = np.empty((*asked.shape, count))
    for own in range(count):
        others = [other for other in range(count) if other != own]
        apart = known[:, None, [own]] - known[:, None, others]
        weights[..., own] = np.prod((asked[..., None] - known[:, None, others]) / apart, axis=-1)
    return weights


def _usual_sizes(values: np.ndarray, apart: int) -> np.ndarray:
    """Return the usual size of each of values (n,): the larger median of values at least `apart` before or after it.

    The result is above 0.
    """
    count = len(values)
    width = min(USUAL_RUNS, count)
    medians = np.median(sliding_window_view(values, width), axis=-1)
    # Near an end, only the existing side counts.
    before, behind = np.arange(count) - apart - width + 1, np.arange(count) + apart
    sides = [
        np.where((at >= 0) & (at < len(medians)), medians[at.clip(0, len(medians) - 1)], 0.0) for at in (before, behind)
    ]
    return np.maximum(np.maximum(*sides), np.finfo(float).tiny)
