"""Which terms the channels of sources should have: their differences as polynomials on pieces of time, and carriers.

A difference is smooth within a span. It is tried on Chebyshev nodes, of all spans of all sources at once. Where no
polynomial follows it, the span is split, at its breaks, and then at whole frames, halves, quarters and eighths, and
the pieces are tried in the next round. What is left in the end lies between two neighbouring eighths of frames: there
it runs straight, and is exact on both.

Ranges of modifiers include both ends. At keys nothing is to be added, so ranges open by one step of single precision;
of two pieces that meet the earlier one has the frame. Frames are those of the Action.
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
"""How many moments a piece is tried on."""

MOST_DEGREE = NODES_PER_PIECE - 5
"""The highest degree of a polynomial. What is behind it tells whether all has been seen."""

UNSEEN_COEFFICIENT_FACTOR = 10.0
"""How many times the last coefficients the unseen ones may add up to. Those of a kink fall as slowly as 1 / k^2, which
makes five times; and each of them is missed twice, as nodes take it for one of the seen ones."""

LOCATION_TOLERANCE = 4e-6
"""How far off location may be, in units: what single precision leaves of 64 units anyway, and no one sees."""

ROTATION_SCALE_TOLERANCE = 2e-6
"""How far off rotation and scale may be: 2 micrometres at an arm's length."""

COMPONENT_TOLERANCES = np.full(10, ROTATION_SCALE_TOLERANCE)
COMPONENT_TOLERANCES[ROWS[LOCATION]] = LOCATION_TOLERANCE
"""The tolerances of rows, where values are not large."""

SINGLE_PRECISION = 1e-7
"""Nothing is closer than this share of the values that differences are added to: a step is 1.2e-7 of them at most."""

SPAN_EDGE_RATIO = 1e-8
"""The share of a span that moments keep away from its ends, where there is no difference but next to which there is."""

POLYNOMIAL_TOLERANCE_RATIO = 0.5
"""The share of the tolerance that polynomials may use up; carriers have the rest."""

PARTS_PER_FRAME = 1, 2, 4, 8
"""Into how many parts of a frame spans may be split: renderers blur motion by samples on such."""

LAST_FRAME = 1048574
"""Blender's MAXFRAMEF: ranges of modifiers reach from its negative to it."""


class _Pieces(NamedTuple):
    """P pieces of spans that are to be tried."""

    spans: np.ndarray
    """The number of the span among all, rising, shape (P,)."""

    first: np.ndarray
    """Shape (P,), in single precision, as `last` is."""

    last: np.ndarray

    rows: np.ndarray
    """Which rows are open, shape (P, 10)."""


class _Polynomials(NamedTuple):
    """Finished ones, a row each."""

    spans: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    last: np.ndarray
    series: np.ndarray
    """Shape (., NODES_PER_PIECE)."""

    tolerances: np.ndarray
    """What carriers may use up."""

    def some(self, rows: np.ndarray) -> _Polynomials:
        return _Polynomials(*(values[rows] for values in self))


class _Spans:
    """The spans of all sources, and their differences on any frames: where planning meets evaluation."""

    def __init__(self, sources: Sequence[KeyedTransform]) -> None:
        self.sources = sources
        found = [(number, span) for number, source in enumerate(sources) for span in spans(source)]
        self.all: list[Span] = [span for _, span in found]
        self.owners = np.array([number for number, _ in found], int)
        ends = np.array([(span.first, span.last) for span in self.all]).reshape(-1, 2)
        self.first, self.last = np.float32(np.clip(ends, -LAST_FRAME, LAST_FRAME)).astype(float).T
        self.is_key = np.array([(span.first_is_key, span.last_is_key) for span in self.all], bool).reshape(-1, 2)

    def pieces(self) -> _Pieces:
        """Return all spans as pieces, but for those with no frame of single precision inside."""
        rows = np.zeros((len(self.all), len(COMPONENT_TOLERANCES)), bool)
        for number, span in enumerate(self.all):
            rows[number, list(span.rows)] = True
        every = np.flatnonzero(_after(self.first) < self.last)
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
    """Return, for each source, the terms that its channels should have, by rows; in order of time.

    Rows without terms are left out.
    """
    result: list[dict[int, list[Term]]] = [{} for _ in sources]
    every = _Spans(sources)
    finished, pieces = [], every.pieces()
    while len(pieces.spans):
        polynomials, pieces = _tried(every, pieces)
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


def _after(frames: np.ndarray) -> np.ndarray:
    return np.nextafter(np.float32(frames), np.float32(np.inf)).astype(float)


def _before(frames: np.ndarray) -> np.ndarray:
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
    first = np.where(opens, _after(found.first), found.first)
    return np.stack([first, np.where(closes, _before(found.last), found.last)], 1)


def _tried(every: _Spans, pieces: _Pieces) -> tuple[_Polynomials, _Pieces]:
    """Return the polynomials of the rows that one follows, and the pieces with the other rows open.

    A polynomial ends where the difference does, so that what is 0 at keys stays so. Where there is no eighth of a frame
    inside of a piece it runs straight.
    """
    nodes, to_series = fit_of(NODES_PER_PIECE)
    middles, halves = (pieces.first + pieces.last) / 2, (pieces.last - pieces.first) / 2
    moments = middles[:, None] + halves[:, None] * np.concatenate([[-1.0], nodes, [1.0]])
    difference, native = every.differences(pieces.spans, moments)
    tolerances = np.maximum(COMPONENT_TOLERANCES, SINGLE_PRECISION * np.abs(native).max(axis=2))
    series = (difference[..., 1:-1].reshape(-1, NODES_PER_PIECE) @ to_series).reshape(difference[..., 1:-1].shape)
    # What each degree leaves: at most, and at both ends, where a slope may be infinite and no node sees it.
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
    # Near gimbal lock several values of all angles turn alike, and which it is hangs on the frames that are asked for.
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
    """Return the parts of pieces.

    They are between breaks, or else on both sides of the whole frame that is nearest to the middle; or of the half, the
    quarter or the eighth where no whole frame is inside.
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
