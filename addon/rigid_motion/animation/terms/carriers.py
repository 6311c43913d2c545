"""Polynomials on pieces of time as *terms*: products of linear factors that Generator modifiers add to an F-curve.

Blender evaluates a Generator in factorised form in single precision, `fcm_generator_evaluate` in
source/blender/blenkernel/intern/fmodifier.cc:

    value = 1; for each factor: value *= slope * frame + offset

Single precision determines the form of terms. The slope of a factor is a power of two, so `slope * frame` is exact,
with or without a fused multiplication, and the factor is the distance of the frame from its root with a relative error
of 2^-24 at most. The amplitude is the last factor, which is constant. The remaining problem is that roots must be
frames that single precision can store. There are two ways around it:

- A *pair*: d = (d + K T) - K T, where T is the Chebyshev polynomial of the degree of d. Where K is large enough for
  d + K T to have the signs of T at the extremes of T, both have all their roots between these, and are one term each,
  for any degree. K is of the size of d. Roots are rounded, which costs about K times the degree times the step of
  single precision over half the length of the piece, and more at its ends. If that is too much, the pair becomes a
  *chain*: d + K T - E T is rounded instead, with E a few times the rounding error e. The next product is then E T - e,
  which also has all its roots in the piece. It is so small that its own rounding matters less, by the ratio of e to d;
  and so on. Each further term gains as many digits as the first two have.
- *Bernstein* terms b C(n, i) s^i (1 - s)^(n - i): their roots are the ends of the piece, and are exact.

Polynomials are Chebyshev series in x, which runs from -1 to 1 on their piece.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

MIN_CHAIN_PRODUCTS, MAX_CHAIN_PRODUCTS = 2, 4
"""The fewest and the most products in a chain."""

ROOT_MARGIN_RATIO = 0.05
"""K exceeds its minimum by this fraction of d, to keep the roots of d + K T apart from each other."""

ROUNDING_LEFT_FACTOR = 4.0
"""E as a multiple of the rounding error: large enough for the next product of the chain to have all its roots."""

SMALL_STEP = 1e-5
"""After a Newton step smaller than this, the root is exact far beyond single precision."""

CARRIER_TOLERANCE_RATIO = 0.85
"""The fraction of its tolerance that a carrier may use on the frames tried, as other frames are slightly worse."""

DROPPED_TOLERANCE_RATIO = 0.25
"""The fraction of the tolerance below which a Bernstein coefficient needs no term. Errors do not add up: the sum of all
Bernstein polynomials is 1."""

MOST_STEPS = 40
"""The most Newton steps to a root; most roots take six."""

CHUNK_PIECES = 512
"""The number of pieces of similar degree computed at once: their arrays fit the processor's cache."""

MOST_KNOWN = 16384
"""The number of pieces to cache, enough for a large rig. While one key is dragged, all other pieces stay the same."""


class Term(NamedTuple):
    """The product that one Generator modifier adds from its first to its last frame, inclusive; in single precision."""

    first: float
    last: float
    coefficients: tuple[float, ...]
    """As in Blender: slope and offset of each factor; the last factor is constant, (0, amplitude)."""


def _single(values: ArrayLike) -> np.ndarray:
    return np.asarray(values, dtype=np.float32)


class _Products(NamedTuple):
    """A product of linear factors for each of S pieces; factors beyond the degree of a piece are 1."""

    slopes: np.ndarray
    """Shape (S, N), 0 beyond the degree."""

    offsets: np.ndarray
    """Shape (S, N)."""

    amplitudes: np.ndarray
    """Shape (S,); 0 means that there is no term."""

    def at(self, frames: np.ndarray) -> np.ndarray:
        """Return the values on frames (S, M), as Blender computes them."""
        slopes, offsets, amplitudes, frames = map(_single, (*self, frames))
        return _multiplied(slopes, offsets, frames) * amplitudes[:, None]

    def some(self, rows: np.ndarray) -> _Products:
        return _Products(*(values[rows] for values in self))

    def coefficients(self) -> list[tuple[float, ...]]:
        """Return the coefficients of the terms."""
        slopes, offsets, amplitudes = self
        degrees, every = np.count_nonzero(slopes, axis=1), np.arange(len(slopes))
        table = np.zeros((len(slopes), slopes.shape[1] + 1, 2))
        table[:, :-1, 0], table[:, :-1, 1] = slopes, offsets
        table[every, degrees, 1] = amplitudes
        values, ends = table.reshape(-1, 2 * table.shape[1]).tolist(), (2 * degrees + 2).tolist()
        return [tuple(row[:end]) for row, end in zip(values, ends, strict=True)]


def _multiplied(slopes: np.ndarray, offsets: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the products of factors (S, N) on frames (S, M), in the precision of the arguments."""
    factors = slopes.T[..., None] * frames
    factors += offsets.T[..., None]
    return factors.prod(axis=0)


@lru_cache(maxsize=64)
def fit_of(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev nodes (count,), rising, and the matrix (count, count) from values at the nodes to series."""
    x = np.cos(np.pi * (np.arange(count)[::-1] + 0.5) / count)
    weights = np.full(count, 2.0 / count)
    weights[0] /= 2
    return x, chebyshev.chebvander(x, count - 1) * weights


@lru_cache(maxsize=64)
def _to_powers(count: int) -> np.ndarray:
    """Return the matrix (count, count) from Chebyshev series to coefficients of powers, as rows."""
    matrix = np.eye(count)
    for k in range(2, count):
        matrix[k, 1:] = 2.0 * matrix[k - 1, :-1]
        matrix[k] -= matrix[k - 2]
    return matrix


@lru_cache(maxsize=64)
def _to_bernstein(degree: int) -> np.ndarray:
    """Return the matrix (degree + 1, degree + 1) from Chebyshev series to Bernstein coefficients, as rows."""
    x, i = fit_of(degree + 1)[0][:, None], np.arange(degree + 1)
    bernsteins = [comb(degree, k) for k in i.tolist()] * ((1 + x) / 2) ** i * ((1 - x) / 2) ** (degree - i)
    return np.linalg.solve(bernsteins, chebyshev.chebvander(x[:, 0], degree)).T


def _values_of(series: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the values of Chebyshev series (S, N + 1) at x, (S, M) or (M,); shape (S, M)."""
    values = np.zeros((len(series), x.shape[-1]))
    for coefficients in (series @ _to_powers(series.shape[1])).T[::-1, :, None]:
        values *= x
        values += coefficients
    return values


def _roots(series: np.ndarray, low: np.ndarray, x: np.ndarray, high: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return the root of series (S, N + 1) in each bracket (S, N), with these signs at its high end, by Newton steps.

    A step out of the remaining bracket is replaced by one to its middle.
    """
    powers = (series @ _to_powers(series.shape[1])).T[::-1, :, None]
    for _ in range(MOST_STEPS):
        value, slope = np.zeros((2, *x.shape))
        for coefficients in powers:
            slope *= x
            slope += value
            value *= x
            value += coefficients
        is_above = value * signs > 0
        low, high = np.where(is_above, low, x), np.where(is_above, x, high)
        step = x - value / np.where(slope, slope, 1.0)
        before, x = x, np.where((low <= step) & (step <= high), step, (low + high) / 2)
        if abs(x - before).max() < SMALL_STEP:
            break
    return x


class _Pieces(NamedTuple):
    """S pieces to make chains for."""

    middles: np.ndarray
    """Their middle frames, shape (S, 1)."""

    halves: np.ndarray
    """Half their lengths in frames, shape (S, 1)."""

    slopes: np.ndarray
    """Slopes of factors: powers of two between 1 and 2 over half the length; 0 beyond the degree, (S, N)."""

    low: np.ndarray
    """The extreme of T below each of its roots, shape (S, N). Roots are taken from both ends in turn, which keeps
    partial products moderate."""

    roots: np.ndarray
    """The roots of T, shape (S, N)."""

    high: np.ndarray
    """The extreme of T above each root, shape (S, N)."""

    signs: np.ndarray
    """The signs of K T at the upper extremes, shape (S, N)."""

    spare: np.ndarray
    """The values of T, with the sign of K, at the nodes of `fit_of`, shape (S, N + 1)."""

    @classmethod
    def of(
        cls, series: np.ndarray, degrees: np.ndarray, first: np.ndarray, last: np.ndarray
    ) -> tuple[_Pieces, np.ndarray]:
        """Return pieces for series (S, N + 1) of degrees (S, 1), between frames (S, 1), and the size of K, (S, 1)."""
        halves, turns = (last - first) / 2, np.pi / degrees
        extremes, factors = np.arange(series.shape[1]), np.arange(series.shape[1] - 1)
        signs = np.where(extremes <= degrees, (-1.0) ** extremes, 0.0)
        at_extremes = _values_of(series, np.cos(turns * extremes)) * signs
        # Choose d + K T or d - K T, the one with the smaller K.
        needed = np.maximum(np.stack([-at_extremes.min(1), at_extremes.max(1)]), 0.0)
        sides = np.where(needed[0] <= needed[1], 1.0, -1.0)[:, None]
        numbers = np.where(factors % 2, degrees - 1 - factors // 2, factors // 2) * (factors < degrees)
        slopes = np.where(factors < degrees, np.ldexp(1.0, 1 - np.frexp(halves)[1]), 0.0)
        low, roots, high = (np.cos(turns * (numbers + part)) for part in (1.0, 0.5, 0.0))
        spare = sides * np.cos(degrees * np.arccos(fit_of(len(extremes))[0]))
        result = cls((first + last) / 2, halves, slopes, low, roots, high, sides * (-1.0) ** numbers, spare)
        return result, (needed.min(0) + ROOT_MARGIN_RATIO * abs(at_extremes).max(1))[:, None]

    def some(self, rows: np.ndarray) -> _Pieces:
        return _Pieces(*(values[rows] for values in self))

    def product_of(self, values: np.ndarray, roots: np.ndarray | None = None) -> tuple[_Products, np.ndarray]:
        """Return the products nearest to values (S, N + 1) at the nodes of `fit_of`, and the remaining differences.

        If roots are not given, they are searched between the extremes of T, where values have the signs of K T. Only
        roots and amplitudes are rounded.
        """
        nodes, fit = fit_of(values.shape[1])
        x = _roots(values @ fit, self.low, self.roots, self.high, self.signs) if roots is None else roots
        offsets = -self.slopes * _single(self.middles + self.halves * x) + (self.slopes == 0.0)
        reached = _multiplied(self.slopes, offsets, self.middles + self.halves * nodes)
        amplitudes = _single((reached * values).sum(1) / (reached * reached).sum(1)).astype(float)
        return _Products(self.slopes, offsets, amplitudes), values - reached * amplitudes[:, None]


def _bernstein(series: np.ndarray, first: np.ndarray, last: np.ndarray, dropped: np.ndarray) -> list[_Products]:
    """Return Bernstein terms for series (S, n + 1) on pieces between frames (S, 1), without those below `dropped`."""
    degree = series.shape[1] - 1
    values = series @ _to_bernstein(degree)
    values[abs(values) <= dropped] = 0.0
    length, exponents = np.frexp(last - first)
    values *= [comb(degree, i) for i in range(degree + 1)] / length**degree
    # The factors s and 1 - s get powers of two as slopes, at most 1 over the length.
    scales, result = np.ldexp(1.0, -exponents), []
    for i, amplitudes in enumerate(_single(values).T):
        rises = np.arange(degree) < i
        slopes, offsets = np.where(rises, scales, -scales), np.where(rises, -scales * first, scales * last)
        result.append(_Products(slopes, offsets, amplitudes))
    return result


_term_cache: dict[bytes, list[tuple[float, ...]]] = {}
"""Cached coefficients of terms, by all inputs that they depend on."""


def carry(
    series: np.ndarray, first: np.ndarray, last: np.ndarray, tolerances: np.ndarray
) -> list[list[tuple[float, ...]]]:
    """Return the coefficients of a few terms for each of S polynomials that keep to its tolerance on its piece.

    If no terms do so, the nearest ones are returned.

    Parameters
    ----------
    series : (S, N + 1)
        Chebyshev series; zeros beyond the degree.
    first, last : (S,)
        The first and last frames of pieces, in single precision.
    tolerances : (S,)
        The largest error of terms at any frame of the piece.
    """
    asked = [row.tobytes() for row in np.column_stack((series, first, last, tolerances))]
    if len(_term_cache) > MOST_KNOWN:
        _term_cache.clear()
    pending = np.array([row for row, one in enumerate(asked) if one not in _term_cache], int)
    degrees = np.where(series[pending] != 0, np.arange(series.shape[1]), 0).max(1, initial=0)
    order = np.argsort(degrees, kind="stable")
    for start in range(0, len(order), CHUNK_PIECES):
        some = order[start : start + CHUNK_PIECES]
        rows = pending[some]
        trimmed = series[rows, : degrees[some[-1]] + 1]
        coefficients = _carried(trimmed, degrees[some], first[rows], last[rows], tolerances[rows])
        _term_cache.update(zip([asked[row] for row in rows.tolist()], coefficients, strict=True))
    return [_term_cache[one] for one in asked]


def _carried(
    series: np.ndarray, degrees: np.ndarray, first: np.ndarray, last: np.ndarray, tolerances: np.ndarray
) -> list[list[tuple[float, ...]]]:
    """Return coefficients of terms for pieces of rising degrees: see `carry`."""
    first, last = first[:, None], last[:, None]
    middles, halves = (first + last) / 2, (last - first) / 2
    frames = _single(middles + halves * np.cos(np.linspace(np.pi, 0, 2 * series.shape[1] + 15))).astype(float)
    wanted = _values_of(series, (frames - middles) / halves)
    allowed = CARRIER_TOLERANCE_RATIO * tolerances
    result: list[list[tuple[float, ...]]] = [[] for _ in degrees]
    errors = abs(wanted).max(1)

    def try_out(rows: np.ndarray, products: list[_Products], most: float = np.inf) -> None:
        """Use products as the terms of pieces if there are at most `most` of them and their errors are smaller."""
        found = abs(sum(product.at(frames[rows]) for product in products) - wanted[rows]).max(1)
        counts = sum((product.amplitudes != 0.0).astype(int) for product in products)
        nearer = (found < errors[rows]) & (counts <= most)
        errors[rows[nearer]] = found[nearer]
        terms = zip(*(product.some(nearer).coefficients() for product in products), strict=True)
        for row, of_row in zip(rows[nearer].tolist(), terms, strict=True):
            result[row] = [each for each in of_row if each[-1]]

    def try_bernstein(highest: float, most: float) -> None:
        for degree in np.unique(degrees[(errors > allowed) & (degrees <= highest)]).tolist():
            rows = np.flatnonzero((errors > allowed) & (degrees == degree))
            dropped = DROPPED_TOLERANCE_RATIO * tolerances[rows, None]
            try_out(rows, _bernstein(series[rows, : degree + 1], first[rows], last[rows], dropped), most)

    # At keys polynomials are 0, so a polynomial needs fewer Bernstein terms: one less than its degree.
    try_bernstein(MIN_CHAIN_PRODUCTS + 1, MIN_CHAIN_PRODUCTS)
    rows = np.flatnonzero((errors > allowed) & (degrees > 1))
    if len(rows):
        pieces, size = _Pieces.of(series[rows], degrees[rows, None], first[rows], last[rows])
        product, left = pieces.product_of(-size * pieces.spare, pieces.roots)
        values, chain = _values_of(series[rows], fit_of(series.shape[1])[0]) + size * pieces.spare + left, [product]
    while len(rows):
        product, left = pieces.product_of(values)
        try_out(rows, [*chain, product])
        missed = errors[rows] > allowed[rows]
        if len(chain) == MAX_CHAIN_PRODUCTS - 1 or not missed.any():
            break
        rows, pieces, values, left = rows[missed], pieces.some(missed), values[missed], left[missed]
        spare = ROUNDING_LEFT_FACTOR * abs(left).max(1, keepdims=True) * pieces.spare
        product, left = pieces.product_of(values - spare)
        values, chain = left + spare, [*(each.some(missed) for each in chain), product]
    try_bernstein(np.inf, np.inf)
    return result
