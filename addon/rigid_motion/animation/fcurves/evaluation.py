"""The values of many curves on many frames. Curves that share their timing and frames are evaluated together.

Results are doubles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...motion.piecewise import combine
from .keys import BEZIER, Keys, fold
from .spans import Spans

BLOCK = 16384
"""Frames worked on at once: few enough for the processor's caches, enough to make light of the calls to NumPy."""


@dataclass(frozen=True, eq=False)
class Group:
    """Curves with the same timing, and which spans their frames fall into."""

    members: list[tuple[int, slice]]
    """The curves: which of the `Keys` asked for, and which channels of them."""

    curves: np.ndarray
    """Their numbers among all curves, shape (c,)."""

    frames: np.ndarray
    """Frames, rising, shape (m,)."""

    spans: np.ndarray
    """Spans of the first of the curves, shape (s,)."""

    counts: np.ndarray
    """The number of frames, one after the other, that fall into each, shape (s,)."""

    order: np.ndarray | None
    """The places of the frames in the result, shape (m,). None: those that they have."""

    offsets: np.ndarray | None
    """Values that cycles add to each curve, in the order of the result, shape (c, m). None: nothing."""

    def write(self, values: np.ndarray, out: Sequence[np.ndarray]) -> None:
        """Write values (c, m) of the rising frames to where they belong, see `evaluate`."""
        if self.order is not None:
            rising, values = values, np.empty_like(values)
            values[:, self.order] = rising
        if self.offsets is not None:
            values += self.offsets
        begin = 0
        for number, channels in self.members:
            end = begin + channels.stop - channels.start
            out[number][channels] = values[begin:end]
            begin = end


def group_by_timing(
    curves: Sequence[Keys], times: Sequence[np.ndarray], spans: Spans, exact: bool = False
) -> Iterator[Group]:
    """Yield curves that share their timing and are asked for the same frames, wherever in the list they are."""
    requests, distinct = _requests(times, exact)
    groups: dict[tuple, list[tuple[int, slice]]] = {}
    for number, (request, timings) in enumerate(zip(requests, spans.timings(curves), strict=True)):
        for channels, timing in timings:
            groups.setdefault((request, timing), []).append((number, channels))
    rising = [bool(np.all(frames[1:] >= frames[:-1])) for frames in distinct]
    for (request, _), members in groups.items():
        first, frames = curves[members[0][0]], distinct[request]
        offsets = order = None
        if first.cycles is not None:
            frames, _, rounds = fold(first, frames)
            if np.any(rounds):
                ends = [curves[number].values[channels] for number, channels in members]
                offsets = np.multiply.outer(np.concatenate([values[:, -1] - values[:, 0] for values in ends]), rounds)
        if first.cycles is not None or not rising[request]:
            order = np.argsort(frames, kind="stable")
            frames = frames[order]
        ranges = [
            range(spans.first_curve[number] + channels.start, spans.first_curve[number] + channels.stop)
            for number, channels in members
        ]
        rows = np.array([curve for curves_of_keys in ranges for curve in curves_of_keys])
        yield Group(members, rows, frames, *spans.at(int(rows[0]), frames), order, offsets)


def _requests(times: Sequence[np.ndarray], exact: bool) -> tuple[list[int], list[np.ndarray]]:
    """Return which of the distinct arrays of frames each curve is asked for, and those, in Blender's precision."""
    precision = np.float64 if exact else np.float32
    requests: list[int] = []
    distinct: list[np.ndarray] = []
    of_array: dict[int, int] = {}
    of_content: dict[bytes, int] = {}
    for frames in times:
        if id(frames) not in of_array:
            rounded = np.asarray(frames).astype(precision)
            request = of_array[id(frames)] = of_content.setdefault(rounded.tobytes(), len(distinct))
            if request == len(distinct):
                distinct.append(rounded.astype(np.float64))
        requests.append(of_array[id(frames)])
    return requests, distinct


def blocks(groups: Iterable[Group]) -> Iterator[list[Group]]:
    """Yield groups of equally many curves, in lists of about `BLOCK` frames."""
    block: list[Group] = []
    size = 0
    for group in sorted(groups, key=lambda group: len(group.curves)):
        if block and (size >= BLOCK or len(block[0].curves) != len(group.curves)):
            yield block
            block, size = [], 0
        block.append(group)
        size += len(group.frames)
    yield block


def evaluate(
    curves: Sequence[Keys],
    times: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    exact: bool = False,
    out: Sequence[np.ndarray] | None = None,
) -> Sequence[np.ndarray]:
    """Return the values of curves at their times.

    Parameters
    ----------
    curves : sequence of Keys
        Without keys curves are 0 everywhere, as in Blender.
    times : sequence of array, shape (m,)
        Frames for each of them, sub-frames allowed, best in rising order. Curves that have their keys and handles on
        the same frames, and that are asked for the same frames, share the work.
    unit_elastic : bool
        Take the amplitude of ELASTIC relative to the change of value in its segment, instead of in units of value:
        then curves keyed together have the same timing there too.
    exact : bool
        Take frames between keys as they are, not in single precision as Blender does: values are smooth in time then.
    out : sequence of array, shape (c, m), optional
        What to put the values into.

    Returns
    -------
    sequence of array, shape (c, m)
        NaN where keys or handles are not finite. What Blender does to the channels
        of whole numbers and enumerations, which it rounds, is left out.
    """
    if out is None:
        out = [np.empty((len(keys.points), len(frames))) for keys, frames in zip(curves, times, strict=True)]
    if curves:
        with np.errstate(all="ignore"):
            spans = Spans.of(curves, unit_elastic)
            for groups in blocks(group_by_timing(curves, times, spans, exact)):
                _evaluate_groups(groups, spans, out)
    return out


def _evaluate_groups(groups: list[Group], spans: Spans, out: Sequence[np.ndarray]) -> None:
    """Write the values of groups with equally many curves each to where they belong, see `evaluate`."""
    spans_of_first = np.concatenate([group.spans for group in groups])
    counts = np.concatenate([group.counts for group in groups])
    parameters = spans.parameters(spans_of_first, counts, np.concatenate([group.frames for group in groups]))
    # The curves of a group go through spans in the same way: those of the others are as far from their first ones.
    first_spans = spans.first_span[np.stack([group.curves for group in groups], axis=1)]
    rows = spans_of_first + np.repeat(first_spans - first_spans[0], [len(group.spans) for group in groups], axis=1)
    degree = 3 if BEZIER in spans.interpolation[spans_of_first] else 1
    powers = np.empty((degree + 1, len(parameters)))
    powers[0] = 1.0
    for power in range(degree):
        np.multiply(powers[power], parameters, out=powers[power + 1])

    values, begin = np.empty((len(rows), len(parameters))), 0
    combine(spans.polynomials[: degree + 1, rows].transpose(1, 0, 2), powers, counts, values)
    for group in groups:
        group.write(values[:, begin : begin + len(group.frames)], out)
        begin += len(group.frames)
