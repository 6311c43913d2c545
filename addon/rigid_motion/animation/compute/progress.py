"""How far a motion has come in a segment: the share of the chord over all channels.

A radian counts as much as a unit of length. Where no channel changes, and the body makes whole turns all the same, it
is what the interpolation of the keys says.
"""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter

import numpy as np

from ..curves import Keys, evaluate
from .components import PART_OF, ROTATION, ROWS
from .sources import Source


def progress_weights(start: np.ndarray, end: np.ndarray, order: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Return what a segment's progress is made of: weights (10, S) for the channels,
    and what to take off their sum, (S,).
    """
    chord = end - start
    weights = chord.copy()
    if order is None:
        # A unit quaternion moves by half of the angle that the object turns.
        weights[ROWS[ROTATION]] *= 4.0
    total = np.einsum("rs,rs->s", weights, chord)
    weights /= np.where(total > 0.0, total, np.inf)
    return weights, np.einsum("rs,rs->s", weights, start)


def are_idle(weights: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return whether segments turn although no channel changes in them,
    from the weights (., S) of their progress, (S,).
    """
    return (turns != 0) & ~weights.any(axis=0)


def idle_progress(source: Source, frames: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return how far segments have come on frames (m,) where no channel changes: by the interpolation of their keys.

    `first` and `last` are the frames that each runs between, (m,). It is that of a value with the same keys, which
    goes up by one from each to the next, and rests at a key where handles are: those of the first channel that turns.
    """
    turning = [
        (row, keys.only([index]))
        for rows, keys in source.channels
        for index, row in enumerate(rows)
        if PART_OF[row] == ROTATION
    ]
    _, keys = min(turning, key=itemgetter(0), default=(0, source.curves[0].only([0])))
    begin, at, end = evaluate([_counting(keys)] * 3, [first, frames, last])
    way, duration = end - begin, np.where(last > first, last - first, np.inf)
    counted = np.divide(at - begin, way, out=np.zeros_like(at), where=way != 0.0)
    return np.where(way != 0.0, counted, (frames - first) / duration)[0]


def _counting(keys: Keys) -> Keys:
    """Return the curve with the frames and interpolations of these keys, and their numbers for values."""
    numbers = np.arange(len(keys.times), dtype=np.float32)

    def numbered(points: np.ndarray | None) -> np.ndarray | None:
        if points is None:
            return None
        points = points.copy()
        points[0, :, 1] = numbers
        return points

    cycles = keys.cycles
    if cycles is not None:
        before, after = ("REPEAT_OFFSET" if mode == "REPEAT" else mode for mode in (cycles.before, cycles.after))
        cycles = replace(cycles, before=before, after=after)
    return replace(
        keys, points=numbered(keys.points), left=numbered(keys.left), right=numbered(keys.right), cycles=cycles
    )
