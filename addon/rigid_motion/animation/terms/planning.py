"""Planning the terms of channels: fits differences by polynomials on pieces of time, and makes carriers for them.

A difference is smooth within a span. It is fitted on Chebyshev nodes, for all spans of all sources at once. If no
polynomial fits, the span is split at its breaks, and then at whole frames, halves, quarters and eighths; the pieces are
tried in the next round. The last remaining pieces lie between two neighbouring eighths of frames: there the terms are
linear, and exact on both.

Ranges of modifiers include both ends. At keys nothing may be added, so ranges start one step of single precision later;
where two pieces meet, the frame belongs to the earlier one. Frames are those of the Action.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..evaluation.components import LOCATION, ROTATION, ROWS
from ..evaluation.differences import channel_differences
from ..evaluation.sources import KeyedTransform
from ..evaluation.spans import Span, spans
from .carriers import CARRIER_TOLERANCE_RATIO, Term, carry, fit_of

NODES_PER_PIECE = 24
"""The number of Chebyshev nodes on which a piece is fitted."""

MOST_DEGREE = NODES_PER_PIECE - 5
"""The highest degree of a polynomial. The coefficients beyond it show whether the nodes were sufficient."""

UNSEEN_COEFFICIENT_FACTOR = 10.0
"""The largest sum of the unseen coefficients, as a multiple of the last seen ones. Those of a kink fall as slowly as
1 / k^2, which gives 5; and each of them counts twice, as nodes mistake it for a seen one."""

LOCATION_TOLERANCE = 4e-6
"""The tolerance of location, in Blender's units: invisible, and the rounding of single precision at 64 units."""

ROTATION_SCALE_TOLERANCE = 2e-6
"""The tolerance of rotation and scale: 2 micrometres at an arm's length."""

COMPONENT_TOLERANCES = np.full(10, ROTATION_SCALE_TOLERANCE)
COMPONENT_TOLERANCES[ROWS[LOCATION]] = LOCATION_TOLERANCE
"""The tolerances of rows, if values are not large."""

SINGLE_PRECISION = 1e-7
"""The least tolerance, as a fraction of the values that differences are added to: a step is at most 1.2e-7 of them."""

SPAN_EDGE_RATIO = 1e-8
"""The distance of moments from the ends of a span, as a fraction of the span: at the ends the difference is 0, but not
next to them."""

POLYNOMIAL_TOLERANCE_RATIO = 0.5
"""The fraction of the tolerance that polynomials may use; carriers have the rest."""

PARTS_PER_FRAME = 1, 2, 4, 8
"""The parts of a frame at which spans may be split: motion blur samples lie on these."""

LAST_FRAME = 1048574
"""Blender's MAXFRAMEF: ranges of modifiers lie between its negative and it."""


class _Pieces(NamedTuple):
    """P pieces of spans to be fitted."""

    spans: np.ndarray
    """The numbers of their spans among all, rising, shape (P,)."""

    first: np.ndarray
    """Shape (P,), in single precision, as `last` is."""

    last: np.ndarray

    rows: np.ndarray
    """True for the rows still to be fitted, shape (P, 10)."""


class _Polynomials(NamedTuple):
    """Finished polynomials, each for one row of components."""

    spans: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    last: np.ndarray
    series: np.ndarray
    """Shape (., NODES_PER_PIECE)."""

    tolerances: np.ndarray
    """The tolerances left for carriers."""

    def some(self, rows: np.ndarray) -> _Polynomials:
        return _Polynomials(*(values[rows] for values in self))


class _Spans:
    """The spans of all sources, and their differences on any frames: the interface to evaluation."""

    def __init__(self, sources: Sequence[KeyedTransform]) -> None:
        self.sources = sources
        found = [(number, span) for number, source in enumerate(sources) for span in spans(source)]
        self.all: list[Span] = [span for _, span in found]
        self.owners = np.array([number for number, _ in found], int)
        ends = np.array([(span.first, span.last) for span in self.all]).reshape(-1, 2)
        self.first, self.last = np.float32(np.clip(ends, -LAST_FRAME, LAST_FRAME)).astype(float).T
        self.is_key = np.array([(span.first_is_key, span.last_is_key) for span in self.all], bool).reshape(-1, 2)

    def pieces(self) -> _Pieces:
        """Return all spans as pieces, except those with no single-precision frame inside."""
        rows = np.zeros((len(self.all), len(COMPONENT_TOLERANCES)), bool)
        for number, span in enumerate(self.all):
            rows[number, list(span.rows)] = True
        every = np.flatnonzero(_next_single(self.first) < self.last)
        return _Pieces(every, self.first[every], self.last[every], rows[every])

    def differences(self, numbers: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (difference, native) of spans with these rising numbers (P,), on frames (P, M); each (P, 10, M)."""
        first, last = self.first[numbers, None], self.last[numbers, None]
        frames = np.clip(frames, first + SPAN_EDGE_RATIO * (last - first), last - SPAN_EDGE_RATIO * (last - first))
        owners, starts = np.unique(self.owners[numbers], return_index=True)
        asked = [np.unique(of_source, return_inverse=True) for of_source in np.split(frames, starts[1:])]
        values = channel_differences([self.sources[owner] for owner in owners], [rising for rising, _ in asked])
        shape = (len(COMPONENT_TOLERANCES), -1, frames.shape[1])
        both = [np.stack(pair)[:, :, places.ravel()] for pair, (_, places) in zip(values, asked, strict=True)]
        difference, native = np.concatenate(both, axis=2).reshape(2, *shape).transpose(0, 2, 1, 3)
        return difference, native


def plan(sources: Sequence[KeyedTransform]) -> list[dict[int, list[Term]]]:
    """Return, for each source, the terms of its channels, by rows and in order of time.

    Rows without terms are left out.
    """
    result: list[dict[int, list[Term]]] = [{} for _ in sources]
    every = _Spans(sources)
    finished, pieces = [], every.pieces()
    while len(pieces.spans):
        polynomials, pieces = _fit_pieces(every, pieces)
        finished.append(polynomials)
        pieces = _split(every, pieces)
    if not finished:
        return result
    found = _Polynomials(*(np.concatenate(parts) for parts in zip(*finished, strict=True)))
    found = found.some(np.lexsort((found.first, found.rows, every.owners[found.spans])))
    ranges = _ranges(every, found)
    is_seen = ranges[:, 0] <= ranges[:, 1]
    found, ranges = found.some(is_seen), ranges[is_seen]
    carriers = carry(found.series, found.first, found.last, found.tolerances)
    places = zip(every.owners[found.spans].tolist(), found.rows.tolist(), ranges.tolist(), strict=True)
    for (owner, row, (first, last)), some in zip(places, carriers, strict=True):
        if some:
            result[owner].setdefault(row, []).extend(Term(first, last, coefficients) for coefficients in some)
    return result


def _next_single(frames: np.ndarray) -> np.ndarray:
    return np.nextafter(np.float32(frames), np.float32(np.inf)).astype(float)


def _previous_single(frames: np.ndarray) -> np.ndarray:
    return np.nextafter(np.float32(frames), np.float32(-np.inf)).astype(float)


def _ranges(every: _Spans, found: _Polynomials) -> np.ndarray:
    """Return the first and last frame (., 2) of polynomials in order of sources, rows and time."""
    begins, ends = found.first == every.first[found.spans], found.last == every.last[found.spans]
    opens = np.where(begins, every.is_key[found.spans, 0], True)
    closes = np.where(ends, every.is_key[found.spans, 1], False)
    # Two spans may meet where there is no key.
    owners = every.owners[found.spans]
    alike = (owners[1:] == owners[:-1]) & (found.rows[1:] == found.rows[:-1])
    opens[1:] |= alike & (found.last[:-1] == found.first[1:]) & ~closes[:-1]
    first = np.where(opens, _next_single(found.first), found.first)
    return np.stack([first, np.where(closes, _previous_single(found.last), found.last)], 1)


def _fit_pieces(every: _Spans, pieces: _Pieces) -> tuple[_Polynomials, _Pieces]:
    """Return the polynomials for rows that one fits, and the pieces with the other rows still open.

    A polynomial has the exact values of the difference at both ends, so a difference of 0 at keys stays 0. In a piece
    without an eighth of a frame inside, it is linear.
    """
    nodes, to_series = fit_of(NODES_PER_PIECE)
    middles, halves = (pieces.first + pieces.last) / 2, (pieces.last - pieces.first) / 2
    moments = middles[:, None] + halves[:, None] * np.concatenate([[-1.0], nodes, [1.0]])
    difference, native = every.differences(pieces.spans, moments)
    tolerances = np.maximum(COMPONENT_TOLERANCES, SINGLE_PRECISION * np.abs(native).max(axis=2))
    series = (difference[..., 1:-1].reshape(-1, NODES_PER_PIECE) @ to_series).reshape(difference[..., 1:-1].shape)
    # The error of each degree: at most, and at both ends, where a slope may be infinite without any node showing it.
    size = np.abs(series)
    behind = np.cumsum(size[..., ::-1], axis=2)[..., ::-1] - size
    at_first = difference[..., :1] - np.cumsum(series * (-1.0) ** np.arange(NODES_PER_PIECE), axis=2)
    at_last = difference[..., -1:] - np.cumsum(series, axis=2)
    unseen = UNSEEN_COEFFICIENT_FACTOR * behind[..., MOST_DEGREE]
    missed = behind + np.maximum(np.abs(at_first), np.abs(at_last)) + unseen[..., None]
    is_close = missed[..., : MOST_DEGREE + 1] <= POLYNOMIAL_TOLERANCE_RATIO * tolerances[..., None]
    is_close[..., 0] = False
    is_short = np.floor(PARTS_PER_FRAME[-1] * pieces.first) + 1 >= PARTS_PER_FRAME[-1] * pieces.last
    matters = pieces.rows & (size.sum(axis=2) + unseen > CARRIER_TOLERANCE_RATIO * tolerances)
    followed = is_close.any(axis=2) | is_short[:, None]
    # Near gimbal lock different angles give the same rotation; which ones result depends on the frames asked for.
    turning = ROWS[ROTATION]
    is_torn = (matters & ~followed)[:, turning].any(axis=1)
    followed[is_torn, turning], matters[is_torn, turning] = False, pieces.rows[is_torn, turning]
    number, row = np.nonzero(matters & followed)
    degree = np.maximum(is_close.argmax(axis=2), 1)[number, row]
    chosen = np.where(np.arange(NODES_PER_PIECE) <= degree[:, None], series[number, row], 0.0)
    first, last = at_first[number, row, degree], at_last[number, row, degree]
    chosen[:, :2] += np.stack([first + last, last - first], 1) / 2
    allowed = (1.0 - POLYNOMIAL_TOLERANCE_RATIO) * tolerances[number, row]
    polynomials = _Polynomials(pieces.spans[number], row, pieces.first[number], pieces.last[number], chosen, allowed)
    rows = matters & ~followed
    is_open = rows.any(axis=1)
    return polynomials, _Pieces(*(values[is_open] for values in pieces._replace(rows=rows)))


def _split(every: _Spans, pieces: _Pieces) -> _Pieces:
    """Return the parts of split pieces.

    Pieces are split at their breaks, or else at the whole frame nearest to the middle; or at the nearest half, quarter
    or eighth if no whole frame is inside.
    """
    parts: list[tuple[int, float, float]] = []
    ends = zip(pieces.spans.tolist(), pieces.first.tolist(), pieces.last.tolist(), strict=True)
    for number, (span, first, last) in enumerate(ends):
        breaks = np.float32(every.all[span].breaks).astype(float)
        between = np.unique(breaks[(first < breaks) & (breaks < last)]).tolist()
        middles = (float(np.floor(parts_of * (first + last) / 2 + 0.5)) / parts_of for parts_of in PARTS_PER_FRAME)
        between = between or [middle for middle in middles if first < middle < last][:1]
        parts.extend((number, *both) for both in pairwise([first, *between, last]))
    numbers, first, last = np.array(parts).reshape(-1, 3).T
    numbers = numbers.astype(int)
    return _Pieces(pieces.spans[numbers], first, last, pieces.rows[numbers])
