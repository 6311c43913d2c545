"""Polynomials on pieces of time as *terms*: products of linear factors that Generator modifiers add to an F-curve.

Blender evaluates a Generator in factorised form in single precision, `fcm_generator_evaluate` in
source/blender/blenkernel/intern/fmodifier.cc:

    value = 1; for each factor: value *= slope * frame + offset

Single precision is why terms look as they do. The slope of a factor is a power of two, so `slope * frame` is exact,
with or without a fused multiplication, and the factor is the distance of the frame from its root with a relative error
of 2^-24 at most. The amplitude is the last factor, which is constant. What is left is that roots have to be frames that
single precision holds, and there are two ways to live with it:

- A *pair*: d = (d + K T) - K T, where T is the Chebyshev polynomial of the degree of d. Where K is large enough for
  d + K T to have the signs of T at the extremes of T, both have all their roots between these, and are one term each,
  whatever the degree. K is of the size of d. Roots are rounded, which costs about K times the degree times the step of
  single precision over half the length of the piece, and more at its ends. Where that is too much, the pair becomes a
  *chain*: d + K T - E T is rounded instead, with E a few times what rounding has left, e. The next product is then
  E T - e, which has all its roots in the piece, too, and is so small that its own rounding matters less, by as much as
  e is smaller than d; and so on. Each term more gains as many digits as the first two have.
- *Bernstein* terms b C(n, i) s^i (1 - s)^(n - i): their roots are the ends of the piece, and are exact.

Polynomials are Chebyshev series in x, which runs from -1 to 1 on their piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

NOTHING, BERNSTEIN, PAIR, MOST = 0, 1, 2, 4
"""The ways to carry a polynomial; from a pair on they are the number of products in a chain."""

MARGIN = 0.05
"""K is larger than it has to be, by this share of d, so that roots of d + K T are apart from each other."""

LEFT = 4.0
"""How many times what rounding has left is left to the next product of a chain, so that this has all its roots."""

SMALL_STEP = 1e-5
"""After a step of Newton's that is no larger the root is exact to far more than single precision."""

GUARD = 0.85
"""The share of its tolerance that a carrier may use up on the frames where it is tried, as others are a bit worse."""

DROPPED = 0.25
"""The share of its tolerance below which a Bernstein coefficient needs no term. Errors do not add up: the sum of all
Bernstein polynomials is 1."""

MOST_STEPS = 40
"""The most steps to a root; most take six."""

CHUNK = 1024
"""How many pieces, of like degree, are worked on at once: arrays then fit the cache."""


class Term(NamedTuple):
    """What one Generator modifier adds from its first to its last frame, both included; all in single precision."""

    first: float
    last: float
    coefficients: tuple[float, ...]
    """Those of Blender: slope and offset of each factor; the last factor is constant, (0, amplitude)."""


def _single(values: ArrayLike) -> np.ndarray:
    return np.asarray(values, dtype=np.float32)


class _Products(NamedTuple):
    """A product of linear factors for each of S pieces; what is behind the degree of a piece are factors 1."""

    slopes: np.ndarray
    """Shape (S, N)."""

    offsets: np.ndarray
    """Shape (S, N)."""

    amplitudes: np.ndarray
    """Shape (S,)."""

    def at(self, frames: np.ndarray) -> np.ndarray:
        """Return the values on frames (S, M), as Blender works them out."""
        slopes, offsets, amplitudes, frames = map(_single, (*self, frames))
        values = np.ones_like(frames)
        for factor in range(slopes.shape[1]):
            values *= slopes[:, factor, None] * frames + offsets[:, factor, None]
        return values * amplitudes[:, None]

    def coefficients(self, rows: np.ndarray, degrees: np.ndarray) -> list[tuple[float, ...]]:
        """Return those of the terms of some pieces, rows (S,) of booleans, which are of these degrees."""
        count = len(degrees)
        table = np.zeros((count, self.slopes.shape[1] + 1, 2))
        table[:, :-1, 0], table[:, :-1, 1] = self.slopes[rows], self.offsets[rows]
        table[np.arange(count), degrees, 0] = 0.0
        table[np.arange(count), degrees, 1] = self.amplitudes[rows]
        values, ends = table.reshape(count, table.shape[1] * 2).tolist(), (2 * degrees + 2).tolist()
        return [tuple(row[:end]) for row, end in zip(values, ends, strict=True)]


def evaluate(terms: Sequence[Term], frames: np.ndarray) -> np.ndarray:
    """Return what terms add on frames (M,), as Blender works it out; single precision, shape (M,)."""
    frames = _single(frames)
    total = np.zeros_like(frames)
    for first, last, coefficients in terms:
        inside = (frames >= first) & (frames <= last)
        some = frames[inside]
        values = np.ones_like(some)
        for slope, offset in _single(coefficients).reshape(-1, 2):
            values *= slope * some + offset
        total[inside] += values
    return total


def values_of(series: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return Chebyshev series (S, N + 1) at x, (S, M) or (M,), by Clenshaw's recurrence; shape (S, M)."""
    if x.ndim == 1:
        return series @ chebyshev.chebvander(x, series.shape[1] - 1).T
    return _values_and_slopes(series, x, False)[0]


def _values_and_slopes(series: np.ndarray, x: np.ndarray, sloped: bool = True) -> tuple[np.ndarray, np.ndarray]:
    double, b, b_before, s, s_before = 2 * x, *np.zeros((4, *x.shape))
    for k in range(series.shape[1] - 1, 0, -1):
        if sloped:
            s, s_before = double * s + 2 * b - s_before, s
        b, b_before = double * b + series[:, k, None] - b_before, b
    return x * b + series[:, :1] - b_before, x * s + b - s_before


@lru_cache(maxsize=64)
def fit_of(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev nodes (count,), rising, and the matrix (count, count) from values there to series."""
    x = np.cos(np.pi * (np.arange(count)[::-1] + 0.5) / count)
    weights = np.full(count, 2.0 / count)
    weights[0] /= 2
    return x, chebyshev.chebvander(x, count - 1) * weights


@lru_cache(maxsize=64)
def _bernstein_from_chebyshev(degree: int) -> np.ndarray:
    """Return the matrix (degree + 1, degree + 1) from Chebyshev series to Bernstein coefficients, as rows.

    By the closed form of A. Rababah, Transformation of Chebyshev-Bernstein polynomial basis (2003).
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        # T_k in its own degree, raised one by one.
        row = [(-1) ** (k - i) * comb(2 * k, 2 * i) / comb(k, i) for i in range(k + 1)]
        for n in range(k + 1, degree + 1):
            row = [(i * (row[i - 1] if i else 0) + (n - i) * (row[i] if i < n else 0)) / n for i in range(n + 1)]
        matrix[k] = row
    return matrix


@lru_cache(maxsize=64)
def _order(degree: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the roots of T of a degree by number, in the order of factors, and which of `count` factors have one.

    Those from both ends take turns, so that partial products stay moderate.
    """
    order = np.zeros(count, int)
    order[:degree:2] = np.arange((degree + 1) // 2)
    order[1:degree:2] = degree - 1 - np.arange(degree // 2)
    return order, np.arange(count) < degree


class _Pieces(NamedTuple):
    """S pieces of like degree: what their products have in common."""

    degrees: np.ndarray
    """Shape (S,)."""

    middles: np.ndarray
    """Frames, shape (S, 1), as are the others."""

    halves: np.ndarray
    """Half the lengths."""

    scales: np.ndarray
    """The slopes of factors: powers of two that are between 1 and 2 over half the length."""

    roots: np.ndarray
    """Numbers of the roots of T in the order of factors, shape (S, N)."""

    is_root: np.ndarray
    """False behind the degree, shape (S, N)."""

    @classmethod
    def of(cls, degrees: np.ndarray, first: np.ndarray, last: np.ndarray) -> _Pieces:
        length = (last - first)[:, None]
        count = int(degrees.max())
        tables = [np.array(table) for table in zip(*(_order(n, count) for n in range(count + 1)), strict=True)]
        scales = np.ldexp(1.0, 2 - np.frexp(length)[1])
        return cls(degrees, (first + last)[:, None] / 2, length / 2, scales, *(table[degrees] for table in tables))

    def some(self, rows: np.ndarray) -> _Pieces:
        return _Pieces(*(values[rows] for values in self))

    def products(self, x: np.ndarray, wanted: np.ndarray) -> tuple[_Products, np.ndarray]:
        """Return the products with roots at x (S, N) that are nearest to what is wanted, and what they are.

        Values (S, N + 1) are those at the nodes of `fit_of`, without rounding but that of roots and amplitudes to
        single precision.
        """
        roots = _single(self.middles + self.halves * x).astype(float)
        slopes = np.where(self.is_root, self.scales, 0.0)
        offsets = np.where(self.is_root, -self.scales * roots, 1.0)
        frames = self.middles + self.halves * fit_of(x.shape[1] + 1)[0]
        values = np.ones_like(frames)
        for factor in range(x.shape[1]):
            values *= slopes[:, factor, None] * frames + offsets[:, factor, None]
        amplitudes = _single((values * wanted).sum(1) / (values * values).sum(1)).astype(float)
        return _Products(slopes, offsets, amplitudes), values * amplitudes[:, None]

    def chebyshevs(self, count: int) -> np.ndarray:
        """Return the values of T at the nodes of `fit_of`, shape (S, count)."""
        return np.cos(self.degrees[:, None] * np.arccos(fit_of(count)[0]))

    def first_product(self, series: np.ndarray) -> tuple[_Products, np.ndarray, np.ndarray]:
        """Return -K T for series (S, N + 1), the values of what is left, and the sign of K, shape (S, 1)."""
        numbers = np.arange(series.shape[1])
        turns = np.pi / self.degrees[:, None]
        signs = np.where(numbers <= self.degrees[:, None], (-1.0) ** numbers, 0.0)
        at_extremes = values_of(series, np.cos(turns * numbers)) * signs
        # Of d + K T and d - K T the one with the smaller K.
        needed = np.maximum(np.stack([-at_extremes.min(1), at_extremes.max(1)]), 0.0)
        sides = np.where(needed[0] <= needed[1], 1.0, -1.0)[:, None]
        sizes = sides * (needed.min(0) + MARGIN * abs(at_extremes).max(1))[:, None]
        product, values = self.products(np.cos(turns * (self.roots + 0.5)), -sizes * self.chebyshevs(len(numbers)))
        return product, values_of(series, fit_of(len(numbers))[0]) - values, sides

    def product_of(self, values: np.ndarray, sides: np.ndarray) -> tuple[_Products, np.ndarray]:
        """Return what has the signs of T, times those of sides, at the extremes of T as a product, and what is left."""
        turns = np.pi / self.degrees[:, None]
        high, low = np.cos(turns * self.roots), np.cos(turns * (self.roots + 1))
        x = np.cos(turns * (self.roots + 0.5))
        x = _roots(values @ fit_of(values.shape[1])[1], low, x, high, sides * (-1.0) ** self.roots)
        product, reached = self.products(x, values)
        return product, values - reached


def _roots(series: np.ndarray, low: np.ndarray, x: np.ndarray, high: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return the root of series (S, N + 1) in each bracket (S, N), with these signs at its high end: Newton's steps.

    A step out of what is left of the bracket is to its middle instead.
    """
    for _ in range(MOST_STEPS):
        value, slope = _values_and_slopes(series, x)
        is_above = value * signs > 0
        low, high = np.where(is_above, low, x), np.where(is_above, x, high)
        step = x - value / np.where(slope, slope, 1.0)
        before, x = x, np.where((low <= step) & (step <= high), step, (low + high) / 2)
        if abs(x - before).max() < SMALL_STEP:
            break
    return x


class _Bernstein(NamedTuple):
    """Bernstein terms of one degree n for each of S pieces."""

    first: np.ndarray
    """Shape (S, 1)."""

    last: np.ndarray
    """Shape (S, 1)."""

    scales: np.ndarray
    """The slopes of factors: powers of two, at most 1 over the length; shape (S, 1)."""

    amplitudes: np.ndarray
    """Shape (S, n + 1); 0 where there is no term."""

    @classmethod
    def of(cls, series: np.ndarray, first: np.ndarray, last: np.ndarray, dropped: np.ndarray) -> _Bernstein:
        """Return terms for series (S, n + 1), but for coefficients that are no larger than `dropped` (S,)."""
        degree = series.shape[1] - 1
        values = series @ _bernstein_from_chebyshev(degree)
        values[abs(values) <= dropped[:, None]] = 0.0
        length, exponents = np.frexp(last - first)
        values *= [comb(degree, i) for i in range(degree + 1)] / length[:, None] ** degree
        return cls(first[:, None], last[:, None], np.ldexp(1.0, -exponents)[:, None], _single(values))

    def at(self, frames: np.ndarray) -> np.ndarray:
        """Return the sums on frames (S, M), as Blender works them out."""
        first, last, scales, frames = map(_single, (*self[:3], frames))
        rising, falling = (frames - first) * scales, (last - frames) * scales
        total, power = np.zeros_like(frames), np.ones_like(frames)
        degree = self.amplitudes.shape[1] - 1
        for i in range(degree + 1):
            values = power.copy()
            for _ in range(degree - i):
                values *= falling
            total += values * self.amplitudes[:, i, None]
            power *= rising
        return total

    def coefficients(self, row: int) -> list[tuple[float, ...]]:
        """Return those of the terms of one piece."""
        first, last, scale = (float(values[row, 0]) for values in self[:3])
        degree = self.amplitudes.shape[1] - 1
        rising, falling = (scale, -scale * first), (-scale, scale * last)
        amplitudes = enumerate(self.amplitudes[row].tolist())
        return [rising * i + falling * (degree - i) + (0.0, value) for i, value in amplitudes if value]


def carry(
    series: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    tolerances: np.ndarray,
    ranges: np.ndarray | None = None,
) -> list[list[Term]]:
    """Return the fewest terms for each of S polynomials that follow it within its tolerance on its piece.

    Where none do so, those that come nearest.

    Parameters
    ----------
    series : (S, N + 1)
        Chebyshev series; zeros behind the degree.
    first, last : (S,)
        The frames that pieces run between, in single precision.
    tolerances : (S,)
        How far off terms may be at any frame of the piece.
    ranges : (S, 2), optional
        The first and last frame of terms, where these are not those of the piece.
    """
    asked = [row.tobytes() for row in np.column_stack((series, first, last, tolerances))]
    if len(_known) > MOST_KNOWN:
        _known.clear()
    pending = np.array([row for row, one in enumerate(asked) if one not in _known], int)
    degrees = np.where(series[pending] != 0, np.arange(series.shape[1]), 0).max(1, initial=0)
    order = np.argsort(degrees, kind="stable")
    for start in range(0, len(order), CHUNK):
        some = order[start : start + CHUNK]
        rows = pending[some]
        trimmed = series[rows, : degrees[some[-1]] + 1]
        coefficients = _carried(trimmed, degrees[some], first[rows], last[rows], tolerances[rows])
        _known.update(zip([asked[row] for row in rows.tolist()], coefficients, strict=True))
    ranges = np.stack([first, last], 1) if ranges is None else ranges
    return [
        [Term(begin, end, each) for each in _known[one]]
        for one, (begin, end) in zip(asked, ranges.tolist(), strict=True)
    ]


MOST_KNOWN = 16384
"""How many pieces are remembered: those of a large rig. While one key is dragged, the others stay as they are."""

_known: dict[bytes, list[tuple[float, ...]]] = {}
"""The coefficients of terms by all that they depend on."""


class _Chains(NamedTuple):
    """Products that belong to the chains of some pieces, if these have a number of terms from `least` to `most`."""

    least: int
    most: int
    rows: np.ndarray
    products: _Products


def _chained(
    pieces: _Pieces, series: np.ndarray, frames: np.ndarray, wanted: np.ndarray, allowed: np.ndarray
) -> tuple[list[_Chains], np.ndarray]:
    """Return chains in the order of their products, and how far off they are with PAIR to MOST terms.

    The errors (S, MOST + 1 - PAIR) are inf where fewer terms do.
    """
    errors = np.full((len(series), MOST + 1 - PAIR), np.inf)
    rows = np.arange(len(series))
    product, values, sides = pieces.first_product(series)
    chains = [_Chains(PAIR, MOST, rows, product)]
    added = product.at(frames)
    for count in range(PAIR, MOST + 1):
        product, left = pieces.product_of(values, sides)
        chains.append(_Chains(count, count, rows, product))
        errors[rows, count - PAIR] = abs(added + product.at(frames[rows]) - wanted[rows]).max(1)
        missed = errors[rows, count - PAIR] > allowed[rows]
        if count == MOST or not missed.any():
            break
        rows, pieces = rows[missed], pieces.some(missed)
        values, sides, left, added = values[missed], sides[missed], left[missed], added[missed]
        spare = sides * LEFT * abs(left).max(1, keepdims=True) * pieces.chebyshevs(values.shape[1])
        product, left = pieces.product_of(values - spare, sides)
        chains.append(_Chains(count + 1, MOST, rows, product))
        added, values = added + product.at(frames[rows]), left + spare
    return chains, errors


def _carried(
    series: np.ndarray, degrees: np.ndarray, first: np.ndarray, last: np.ndarray, tolerances: np.ndarray
) -> list[list[tuple[float, ...]]]:
    """Return coefficients of terms for pieces of rising degrees: see `carry`."""
    pieces = _Pieces.of(degrees, first, last)
    tried = np.cos(np.linspace(np.pi, 0, 2 * series.shape[1] + 15))
    frames = _single(pieces.middles + pieces.halves * tried).astype(float)
    wanted = values_of(series, (frames - pieces.middles) / pieces.halves)
    allowed = GUARD * tolerances
    # How many terms, and how far off they are, of each way.
    counts = np.tile([0, 0, *range(PAIR, MOST + 1)], (len(series), 1))
    errors = np.full(counts.shape, np.inf)
    errors[:, NOTHING] = abs(wanted).max(1)
    is_open = errors[:, NOTHING] > allowed

    chains: list[_Chains] = []
    curved = np.flatnonzero(is_open & (degrees > 1))
    if len(curved):
        chains, errors[curved, PAIR:] = _chained(
            pieces.some(curved), series[curved], frames[curved], wanted[curved], allowed[curved]
        )

    bernsteins: list[tuple[np.ndarray, _Bernstein]] = []
    is_chained = (errors[:, PAIR:] <= allowed[:, None]).any(1)
    # At keys, where polynomials are 0, there are terms for one degree less than they have.
    rest = np.flatnonzero(is_open & ((degrees <= MOST + 1) | ~is_chained))
    for degree in np.unique(degrees[rest]).tolist():
        rows = rest[degrees[rest] == degree]
        terms = _Bernstein.of(series[rows, : degree + 1], first[rows], last[rows], DROPPED * tolerances[rows])
        errors[rows, BERNSTEIN] = abs(terms.at(frames[rows]) - wanted[rows]).max(1)
        counts[rows, BERNSTEIN] = np.count_nonzero(terms.amplitudes, axis=1)
        bernsteins.append((rows, terms))

    is_close = errors <= allowed[:, None]
    fewest, nearest = np.where(is_close, counts, np.inf).argmin(1), errors.argmin(1)
    ways = np.where(is_close.any(1), fewest, nearest)
    result: list[list[tuple[float, ...]]] = [[] for _ in ways]
    for least, most, places, products in chains:
        rows = curved[places]
        chosen = (least <= ways[rows]) & (ways[rows] <= most)
        rows = rows[chosen]
        for row, coefficients in zip(rows.tolist(), products.coefficients(chosen, degrees[rows]), strict=True):
            result[row].append(coefficients)
    for rows, terms in bernsteins:
        for number, row in enumerate(rows.tolist()):
            if ways[row] == BERNSTEIN:
                result[row] = terms.coefficients(number)
    return result
