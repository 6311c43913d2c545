"""Terms follow polynomials in single precision, with as few products as possible."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Chebyshev

from rigid_motion.animation.terms.apply import write
from rigid_motion.animation.terms.carriers import MAX_CHAIN_PRODUCTS, Term, carry
from tests.animation.fcurves.test_fcurves import as_fcurve, keys_of
from tests.thoroughness import tried

TOLERANCE = 1e-6


def evaluate(terms: Sequence[Term], frames: np.ndarray) -> np.ndarray:
    """Return what Blender adds on frames for these terms, shape (m,)."""
    with as_fcurve(keys_of((0.0,), (0.0,))) as fcurve:
        for term in terms:
            write(fcurve.modifiers.new("GENERATOR"), term)
        return np.array([fcurve.evaluate(frame) for frame in frames.tolist()])


def error(terms: Sequence[Term], wanted: Callable[[np.ndarray], np.ndarray], frames: np.ndarray) -> float:
    """Return the largest error of terms, on frames in single precision."""
    frames = np.unique(np.float32(frames)).astype(float)
    return abs(evaluate(terms, frames) - wanted(frames)).max()


def smooth(seed: int, degree: int, size: float = 0.2, decay: float = 0.5, zero_ends: bool = True) -> np.ndarray:
    """Return a random polynomial similar to most differences: decreasing coefficients, 0 at both ends."""
    series = np.random.default_rng(seed).normal(size=degree + 1) * decay ** np.arange(degree + 1) * size
    if zero_ends:
        at_first, at_last = Chebyshev(series)(np.array((-1.0, 1.0)))
        series[:2] -= (at_last + at_first) / 2, (at_last - at_first) / 2
    return series


def carried(series: np.ndarray, first: float, last: float) -> list[Term]:
    (found,) = carry(series[None], *np.array([[first], [last], [TOLERANCE]]))
    return [Term(first, last, coefficients) for coefficients in found]


def frames_of(first: float, last: float) -> np.ndarray:
    """Return the whole frames of a piece, eighths, and random frames, both ends included."""
    eighths = np.arange(np.ceil(first * 8), last * 8 + 1)[:20_000] / 8
    others = np.random.default_rng(0).uniform(first, last, 300)
    frames = np.float32(np.concatenate([[first, last], eighths, others]))
    return frames[(frames >= first) & (frames <= last)]


def off(terms: list[Term], series: np.ndarray, first: float, last: float) -> float:
    return error(terms, Chebyshev(series, (first, last)), frames_of(first, last))


@settings(max_examples=tried(300))
@given(
    seed=st.integers(0, 10_000),
    degree=st.integers(1, 19),
    first=st.integers(-80_000, 800_000).map(lambda eighth: eighth / 8)
    | st.sampled_from([0.0, 1.0, -500.0, 3000.0, 99.3125, 100_000.0]),
    length=st.sampled_from([0.375, 1.0, 2.5, 12.0, 24.0, 41.4, 250.0, 120_000.0]),
    size=st.sampled_from([0.0, 1e-7, 1e-6, 1e-3, 0.1, 0.2, 2.0]),
    zero_ends=st.booleans(),
)
def test_any_polynomial_is_followed_at_any_frame_by_exact_factors(seed, degree, first, length, size, zero_ends):
    """The error is within the tolerance, or within the rounding of products of that many factors at this size."""
    series, last = smooth(seed, degree, size, zero_ends=zero_ends), float(np.float32(first + length))
    terms = carried(series, first, last)
    assert off(terms, series, first, last) <= max(TOLERANCE, 5e-6 * size)
    assert len(terms) <= (max(degree + 1, MAX_CHAIN_PRODUCTS) if size > 1e-7 else 0)
    frames = frames_of(first, last)[:, None]
    for term in terms:
        coefficients = np.array(term.coefficients)
        assert np.array_equal(np.float32(coefficients), coefficients)
        slopes, offsets = coefficients.reshape(-1, 2).T
        assert slopes[-1] == 0.0
        assert np.all(np.frexp(abs(slopes[:-1]))[0] == 0.5)
        # With and without fused multiply-add.
        fused = np.float32(slopes * frames.astype(float) + offsets)
        assert np.array_equal(fused, np.float32(slopes) * frames + np.float32(offsets))


def test_two_terms_carry_any_degree_and_each_more_what_rounding_has_left():
    """On distant frames. One Bernstein term more than the degree is the last choice."""
    assert {len(carried(smooth(n, n, 0.1, zero_ends=False), 0.0, 16.0)) for n in range(3, 13)} == {2}
    counts = [len(carried(smooth(3, 12, 0.4), first, first + 20.0)) for first in (0.0, 500.0, 20_000.0, 500_000.0)]
    assert counts == [2, 3, MAX_CHAIN_PRODUCTS, 11]


@pytest.mark.parametrize(("series", "count"), [((0.3,), 1), ((0.3, 0.3), 1), ((0.3, 0.1), 2), ((0.3, 0.0, -0.3), 1)])
def test_straight_lines_and_parabolas_between_keys_take_bernstein_terms(series, count):
    terms = carried(np.array(series), 100_000.0, 100_010.0)
    assert len(terms) == count
    assert off(terms, np.array(series), 100_000.0, 100_010.0) < 1e-7
    assert max(len(term.coefficients) for term in terms) <= 2 * len(series)


def test_where_none_is_good_enough_the_nearest_is_taken():
    series = smooth(5, 20, 100.0, 0.9)
    terms = carried(series, 5000.0, 5010.0)
    assert TOLERANCE < off(terms, series, 5000.0, 5010.0) < 1e-5 * abs(series).sum()
