"""Keys between samples: the differences have corners there, which straight lines from sample to sample would cut off.

What is missing at such a key is added by modifiers, each for a range of its own: up to what it lacks, and down again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from ...motion.eulers import extrinsic_eulers_from_quaternions
from ..compute.bodies import other_angles
from ..compute.components import PART_OF, REST, ROTATION, ROWS
from ..compute.sample_rates import Need
from ..compute.samples import MOST_CORNERS
from ..compute.sources import FULL_TURN, SAME_FRAME, Source
from .sampled import Layout, Piece

SHARE = 0.05
"""The least share of the tolerance that makes a corner worth a modifier."""


def corners(
    source: Source, samples: Mapping[int, np.ndarray], layout: Layout, need: Need
) -> tuple[dict[int, list[Piece]], float]:
    """Return what samples, as `differences` returns them, lack at the keys between them.

    That is added to the rows of components that lack anything; and the error of the body at keys where nothing can be.
    """
    if math.isinf(need.tolerance):
        return {}, 0.0
    keys = _keys(source, layout)
    rows = list(samples)
    if not len(keys) or not rows:
        return {}, 0.0
    values = np.stack([samples[row][1::2] for row in rows]).astype(np.float64)
    at = np.floor(keys * layout.rate).astype(int) - layout.first
    shares = keys * layout.rate - layout.first - at
    lines = values[:, at] * (1.0 - shares) + values[:, at + 1] * shares
    lacks = _at_keys(source, rows, lines) - lines
    weights = np.array([2.0 * need.reach if PART_OF[row] == ROTATION else 1.0 for row in rows])
    errors = np.abs(lacks * weights[:, None]).max(axis=0)
    chosen = np.argsort(-errors)[:MOST_CORNERS]
    chosen = np.sort(chosen[errors[chosen] > SHARE * need.tolerance])
    if layout.is_ring or (layout.cycles is not None and not layout.is_apart):
        chosen = chosen[:0]
    left = np.delete(errors, chosen)
    knots = _knots(keys[chosen], at[chosen] + layout.first, layout)
    pieces = {row: list(_pieces(knots, lack[chosen], layout)) for row, lack in zip(rows, lacks, strict=True)}
    return {row: of_row for row, of_row in pieces.items() if of_row}, float(left.max(initial=0.0))


def _keys(source: Source, layout: Layout) -> np.ndarray:
    """Return the frames of the keys between samples, (k,)."""
    keys = source.key_frames
    first, last = layout.first / layout.rate, layout.last / layout.rate
    numbers = keys * layout.rate
    modes = np.concatenate(((0,), source.modes, (0,)))
    is_off = np.abs(numbers - np.rint(numbers)) > 0.5 * SAME_FRAME
    return keys[is_off & (keys > first) & (keys < last) & ((modes[:-1] != 0) | (modes[1:] != 0))]


def _at_keys(source: Source, rows: list[int], near: np.ndarray) -> np.ndarray:
    """Return what the differences are at keys, (rows, k): the original ones, in the sign and turn near to these."""
    original = np.array(REST if source.is_on_top else source.original)
    turning = [number for number, row in enumerate(rows) if PART_OF[row] == ROTATION]
    result = np.repeat(original[rows, None], near.shape[1], axis=1)
    if not turning:
        return result
    if source.order is None:
        result[turning] *= np.where(np.einsum("rk,rk->k", result[turning], near[turning]) < 0.0, -1.0, 1.0)
        return result
    angles = extrinsic_eulers_from_quaternions(original[None, ROWS[ROTATION]], source.order)[0]
    axes = [row - ROWS[ROTATION].start for row in np.array(rows)[turning]]
    candidates = []
    for candidate in (angles, other_angles(angles, source.order)):
        turned = candidate[axes, None]
        candidates.append(turned + FULL_TURN * np.rint((near[turning] - turned) / FULL_TURN))
    apart = [np.abs(candidate - near[turning]).max(axis=0) for candidate in candidates]
    result[turning] = np.where(apart[0] <= apart[1], *candidates)
    return result


def _knots(keys: np.ndarray, before: np.ndarray, layout: Layout) -> list[tuple[float, int]]:
    """Return the frames that lines run between, each with the number of its key, -1 for a sample."""
    knots: list[tuple[float, int]] = []
    shift = layout.shift * layout.rate
    for number, (key, sample) in enumerate(zip(keys.tolist(), before.tolist(), strict=True)):
        start = float(sample + shift)
        if knots and knots[-1] == (start + 1.0, -1):
            knots.pop()
        elif not knots or knots[-1] != (start, -1):
            knots.append((start, -1))
        knots += [(float(np.float32((key + layout.shift) * layout.rate)), number), (start + 1.0, -1)]
    return knots


def _pieces(knots: list[tuple[float, int]], lacks: np.ndarray, layout: Layout) -> Iterator[Piece]:
    heights = [0.0 if number < 0 else float(lacks[number]) for _, number in knots]
    begin, end = layout.outermost
    for (first, _), (last, _), low, high in zip(knots, knots[1:], heights, heights[1:], strict=False):
        if (low or high) and first >= begin and last <= end:
            slope = (high - low) / (last - first)
            start = low - slope * first
            # On the frame where two meet Blender would add both; on the outermost key nothing is to be added.
            if high:
                last = float(np.nextafter(np.float32(last), np.float32(-np.inf)))
            if low and first == begin:
                first = float(np.nextafter(np.float32(first), np.float32(np.inf)))
            yield Piece(first, last, start, slope)
