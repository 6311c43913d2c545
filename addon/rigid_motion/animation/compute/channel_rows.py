"""What channels say by themselves: the values of many sources, as rows of components, each source behind the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from ..curves import Keys, evaluate
from .components import REST, ROTATION, ROWS, SCALE
from .sources import SAME_FRAME, Source


def each(sources: Sequence[Source], counts: Iterator[int]) -> list[tuple[Source, slice]]:
    """Return each source with the span of what it has this many of."""
    bounds = [0, *itertools.accumulate(counts)]
    return [(source, slice(*span)) for source, span in zip(sources, itertools.pairwise(bounds), strict=True)]


def sampled(
    samples: list[tuple[Source, slice]],
    frames: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Return the channels' own values at the frames of each source, m in all, with a row for each of the `height`."""
    rows = np.empty((height([source for source, _ in samples]), samples[-1][1].stop)) if out is None else out
    curves, times, out, apart = [], [], [], []
    for (source, span), at in zip(samples, frames, strict=True):
        _rest(rows[:, span], source)
        for keyed_rows, keys in source.channels:
            if at is source.key_frames and source.is_together:
                rows[keyed_rows, span] = keys.values
                continue
            curves.append(keys)
            times.append(at)
            if keyed_rows[-1] - keyed_rows[0] < len(keyed_rows):
                out.append(rows[keyed_rows[0] : keyed_rows[-1] + 1, span])
            else:
                out.append(np.empty((len(keyed_rows), len(at))))
                apart.append((keyed_rows, span, out[-1]))
    evaluate(curves, times, unit_elastic=unit_elastic, out=out)
    for keyed_rows, span, values in apart:
        rows[keyed_rows, span] = values
    return rows


def channels_at_ends(
    segments: list[tuple[Source, slice]], *, unit_elastic: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values where each segment starts and where it ends, rows as `sampled` has them."""
    sources = [source for source, _ in segments]
    keys = each(sources, (len(source.key_frames) for source in sources))
    rows = sampled(keys, [source.key_frames for source in sources], unit_elastic=unit_elastic)
    begins = np.delete(np.arange(rows.shape[1]), [span.stop - 1 for _, span in keys])
    start, end = rows[:, begins], rows[:, begins + 1]
    for source, span in segments:
        for keyed_rows, channels in source.channels:
            if channels.cycles is None:
                continue
            # A cycle whose ends differ jumps: one round ends on its last value, the next starts on its first.
            jumps = _jumps(channels, source.key_frames)
            for row, values in zip(keyed_rows, channels.values, strict=True):
                start[row, span][jumps[:-1]], end[row, span][jumps[1:]] = values[0], values[-1]
    return start, end


def height(sources: Sequence[Source]) -> int:
    """Return how many of the components are needed for what the sources key."""
    return ROWS[SCALE].stop if any(SCALE in source.keyed for source in sources) else ROWS[ROTATION].stop


def filled_height(sources: Sequence[Source]) -> int:
    """Return how many of them for what is filled in."""
    return ROWS[SCALE].stop if sources[0].uniform_scale else ROWS[ROTATION].stop


def _rest(rows: np.ndarray, source: Source) -> None:
    """Fill in what a source does not key."""
    for name, part in ROWS.items():
        if name not in source.keyed and part.start < len(rows):
            rows[part] = REST[part, None]
    for row, value in source.rest.items():
        rows[row] = value
    if source.order is not None:
        rows[6] = 0.0


def _jumps(keys: Keys, times: np.ndarray) -> np.ndarray:
    """Return at which of these times a cyclic channel goes from its last value to its first, shape (n,)."""
    cycles = keys.cycles
    first, last = keys.times[[0, -1]]
    if cycles is None or first == last:
        return np.zeros(times.shape, dtype=bool)
    rounds = (times - first) / (last - first)
    whole = np.rint(rounds)
    after = (whole >= 1) & (cycles.after == "REPEAT") & ((whole <= cycles.after_count) | (cycles.after_count == 0))
    before = (whole <= 0) & (cycles.before == "REPEAT") & ((whole > -cycles.before_count) | (cycles.before_count == 0))
    return (np.abs(rounds - whole) * (last - first) < SAME_FRAME) & (after | before)
