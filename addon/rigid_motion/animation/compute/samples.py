"""Samples of differences: which vary, and how far off a motion is between them, where Blender goes straight on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .sources import Source

NOTHING = 1e-9
"""A component that varies by less is always the same but for rounding errors."""

MOST_SAMPLES = 16
"""The most samples a frame."""

MOST_CORNERS = 64
"""Keys between samples that are reached in one F-curve. Blender asks all modifiers on every frame."""

BLOCK = 16384
"""Samples worked on at once."""

EULER = 2.0**0.5
"""By how much more than the length of three small angles a body can turn."""


def kept_rows(sources: Sequence[Source], delta: np.ndarray, starts: Sequence[int]) -> list[list[int]]:
    """Return the rows that each source has samples of, from the differences (., m) and where those of each start."""
    ranges, kept = np.maximum.reduceat(delta, starts, axis=1) - np.minimum.reduceat(delta, starts, axis=1), []
    for source, constant, varies in zip(sources, delta[:, starts].T, (ranges > NOTHING).T.tolist(), strict=True):
        changing = {row for row in source.filled_rows if varies[row]}
        kept.append(sorted(changing | _held_rows(source, changing, constant)))
    return kept


def _held_rows(source: Source, changing: set[int], constant: np.ndarray) -> set[int]:
    """Return the rows that never change, and have to be held all the same, of what is constant (.,) in them.

    The components of a quaternion are one by one only where they are zero. In the NLA Blender puts what a strip has no
    channel of to its default.
    """
    turning = source.order is None and any(PART_OF[row] == ROTATION for row in changing)
    default = REST if source.order is None else np.where((REST == 1.0) & (np.arange(10) == 3), 0.0, REST)
    return {
        row
        for row in source.filled_rows
        if row not in changing
        and (
            (turning and PART_OF[row] == ROTATION and abs(constant[row]) > NOTHING)
            or (source.in_nla and abs(constant[row] - default[row]) > NOTHING)
        )
    }


class Samples(dict[int, np.ndarray]):
    """The differences of one source at m moments of its range, by the rows of their components where there is any.

    Frame and value of every sample alternately, in single precision, each of shape (2 m,).
    """

    rate = 1
    """The number of samples in a frame."""

    error = 0.0
    """The largest error of a body between them, where that was asked for: see `largest_errors`."""


def largest_errors(
    delta: np.ndarray,
    samples: Sequence[tuple[Source, slice]],
    spans: Sequence[tuple[int, int, int]],
    reaches: Sequence[float],
) -> np.ndarray:
    """Estimate how far each of several bodies is off between its samples, from how these bend.

    A straight line leaves a curve by an eighth of its second difference. At a key it may have a corner.

    Parameters
    ----------
    delta : array, shape (., m)
        The differences at the samples of all: rotations as quaternions or Euler angles.
    samples : sequence of pairs
        Each source with the span of its samples. All turn by quaternions or all by Euler angles.
    spans : sequence
        The first and the last of these, counted from frame 0, and how many there are in a frame.
    reaches : sequence of float
        How far each body reaches from its origin.

    Returns
    -------
    array, shape (sources,)
        Infinite where there are too few samples between two keys to tell.
    """
    starts = np.array([span.start for _, span in samples])
    lengths = np.diff((*starts, delta.shape[1]))
    errors = np.zeros(delta.shape[1])
    reach = np.repeat(reaches, lengths)
    order = samples[0][0].order
    for start in range(1, delta.shape[1] - 1, BLOCK):
        stop = min(start + BLOCK, delta.shape[1] - 1)
        errors[start:stop] = _bends(delta[:, start - 1 : stop + 1], reach[start:stop], order)
    counts = np.ones(delta.shape[1], dtype=bool)
    counts[starts] = counts[starts + lengths - 1] = False
    corners = []
    for (source, span), (first, _, rate) in zip(samples, spans, strict=True):
        keys = source.key_frames * rate - first
        before = np.floor(keys + 1e-6).astype(int)
        behind = np.ceil(keys - 1e-6).astype(int)
        for at in (before, behind):
            counts[span][at[(at >= 0) & (at < span.stop - span.start)]] = False
        corners.append((before, behind))
    largest = np.maximum.reduceat(np.where(counts, errors, 0.0), starts)
    known = np.concatenate(((0,), np.cumsum(counts)))
    for number, ((source, span), (*_, rate), (before, behind)) in enumerate(zip(samples, spans, corners, strict=True)):
        if rate >= MOST_SAMPLES:
            continue
        count = span.stop - span.start
        begins, ends = np.clip(behind[:-1], 0, count), np.clip(before[1:] + 1, 0, count)
        # One may begin and end between two samples.
        is_whole = (before[:-1] >= 0) & (behind[1:] < count)
        is_seen = (is_whole | (begins < ends - 1)) & (source.modes != 0)
        if np.any(is_seen & (known[span.start + begins] == known[span.start + ends])):
            largest[number] = np.inf
    return largest


def _bends(delta: np.ndarray, reach: np.ndarray, order: str | None) -> np.ndarray:
    """Return how far bodies leave the straight line at each of the inner samples (m,), from differences (., m + 2)."""
    bends = 0.125 * (delta[:, :-2] + delta[:, 2:]) - 0.25 * delta[:, 1:-1]
    moved = np.sqrt(np.einsum("rm,rm->m", bends[ROWS[LOCATION]], bends[ROWS[LOCATION]]))
    if order is None:
        turn, quaternion = bends[ROWS[ROTATION]], delta[ROWS[ROTATION], 1:-1]
        # Only what is square to a quaternion turns the body.
        square = np.einsum("rm,rm->m", turn, turn) - np.einsum("rm,rm->m", turn, quaternion) ** 2
        turned = 2.0 * np.sqrt(np.maximum(square, 0.0))
    else:
        turned = EULER * np.sqrt(np.einsum("rm,rm->m", bends[3:6], bends[3:6]))
    grown = np.abs(bends[ROWS[SCALE]]).max(axis=0) if len(bends) > ROWS[SCALE].start else 0.0
    return moved + reach * (turned + grown)
