"""Terms follow polynomials in single precision, by as few products as can be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev

from rigid_motion.animation.terms.carriers import MOST, Term, carry, evaluate

TOLERANCE = 1e-6
PLACES = [0.0, 1.0, -500.0, 3000.0, 100_000.0]


def smooth(seed: int, degree: int, size: float = 0.2, decay: float = 0.5, zero_ends: bool = True) -> np.ndarray:
    """A polynomial at random, as most differences are: with coefficients that fall, 0 at both ends."""
    series = np.random.default_rng(seed).normal(size=degree + 1) * decay ** np.arange(degree + 1) * size
    if zero_ends:
        at_first, at_last = chebyshev.chebval([-1.0, 1.0], series)
        series[:2] -= (at_last + at_first) / 2, (at_last - at_first) / 2
    return series


def carried(series: np.ndarray, first: float, last: float, tolerance: float = TOLERANCE) -> list[Term]:
    (terms,) = carry(series[None], *np.array([[first], [last], [tolerance]]))
    return terms


def frames_of(first: float, last: float) -> np.ndarray:
    """The whole frames of a piece, eighths, and others at random, both ends included."""
    eighths = np.arange(np.ceil(first * 8), last * 8 + 1) / 8
    others = np.random.default_rng(0).uniform(first, last, 300)
    frames = np.unique(np.float32(np.concatenate([[first, last], eighths, others])))
    return frames[(frames >= first) & (frames <= last)].astype(float)


def error(terms: list[Term], series: np.ndarray, first: float, last: float) -> float:
    frames = frames_of(first, last)
    wanted = chebyshev.chebval((2 * frames - first - last) / (last - first), series)
    return abs(evaluate(terms, frames) - wanted).max()


@pytest.mark.parametrize("first", PLACES)
@pytest.mark.parametrize("degree", [1, 2, 3, 6, 10, 14])
@pytest.mark.parametrize("zero_ends", [True, False])
def test_terms_follow_a_polynomial_at_any_frame(first, degree, zero_ends):
    for seed in range(5):
        series = smooth(seed, degree, zero_ends=zero_ends)
        terms = carried(series, first, first + 20.0)
        assert error(terms, series, first, first + 20.0) <= TOLERANCE
        assert len(terms) <= max(degree + 1, 2)


@pytest.mark.parametrize("ends", [(-0.5, 0.25), (10.625, 11.0), (99.3, 140.7), (3000.0, 3001.0), (-6e4, 6e4)])
def test_pieces_may_be_short_and_long_and_end_between_frames(ends):
    first, last = np.float32(ends).astype(float)
    series = smooth(1, 7)
    assert error(carried(series, first, last), series, first, last) <= TOLERANCE


def test_two_terms_carry_any_degree_where_roots_are_precise():
    for degree in range(3, 13):
        series = smooth(degree, degree, 0.1, zero_ends=False)
        assert len(carried(series, 0.0, 16.0)) == 2


def test_each_term_more_carries_what_rounding_has_left():
    """On frames far away; Bernstein terms, one more than the degree, come last."""
    counts = [len(carried(smooth(3, 12, 0.4), first, first + 20.0)) for first in (0.0, 500.0, 20_000.0, 500_000.0)]
    assert counts == [2, 3, MOST, 11]


def test_what_is_below_the_tolerance_takes_no_term():
    assert carried(smooth(1, 9, 1e-7), 1.0, 21.0) == []
    assert carried(np.zeros(12), 1.0, 21.0) == []


@pytest.mark.parametrize(("series", "count"), [((0.3,), 1), ((0.3, 0.3), 1), ((0.3, 0.1), 2), ((0.3, 0.0, -0.3), 1)])
def test_straight_lines_and_parabolas_between_keys_take_bernstein_terms(series, count):
    terms = carried(np.array(series), 100_000.0, 100_010.0)
    assert len(terms) == count
    assert error(terms, np.array(series), 100_000.0, 100_010.0) < 1e-7
    assert max(len(term.coefficients) for term in terms) <= 2 * len(series)


def test_where_none_is_good_enough_the_nearest_is_taken():
    series = smooth(5, 20, 100.0, 0.9)
    terms = carried(series, 5000.0, 5010.0)
    assert TOLERANCE < error(terms, series, 5000.0, 5010.0) < 1e-5 * abs(series).sum()


def test_factors_are_exact_with_and_without_a_fused_multiplication():
    for term in carried(smooth(2, 9), 777.0, 801.0):
        coefficients = np.array(term.coefficients)
        assert np.array_equal(np.float32(coefficients), coefficients)
        slopes, offsets = coefficients.reshape(-1, 2).T
        assert slopes[-1] == 0.0
        assert np.all(np.frexp(abs(slopes[:-1]))[0] == 0.5)
        frames = np.float32(frames_of(777.0, 801.0))[:, None]
        fused = np.float32(slopes * frames.astype(float) + offsets)
        assert np.array_equal(fused, np.float32(slopes) * frames + np.float32(offsets))


def test_ranges_of_terms_are_those_that_are_asked_for():
    series = np.array([smooth(0, 6), smooth(1, 6)])
    ranges = np.float32([(1.1, 20.9), (21.0, 30.0)]).astype(float)
    by_piece = carry(series, np.array([1.0, 21.0]), np.array([21.0, 30.0]), np.full(2, TOLERANCE), ranges)
    assert [[term[:2] for term in terms] for terms in by_piece] == [[tuple(ends)] * 2 for ends in ranges.tolist()]
    assert evaluate(by_piece[0], np.array([1.0, 21.0])).tolist() == [0.0, 0.0]


def test_pieces_do_not_depend_on_those_beside_them():
    series = np.zeros((40, 13))
    for row in range(40):
        series[row, : row % 12 + 2] = smooth(row, row % 12 + 1)
    first = 30.0 * np.arange(40)
    together = carry(series, first, first + 25.0, np.full(40, TOLERANCE))
    assert together == carry(series, first, first + 25.0, np.full(40, TOLERANCE))
    for row in (0, 7, 23, 39):
        wanted = carried(series[row], first[row], first[row] + 25.0)
        assert len(together[row]) == len(wanted)
        assert error(together[row], series[row], first[row], first[row] + 25.0) <= TOLERANCE


@given(
    seed=st.integers(0, 10_000),
    degree=st.integers(1, 19),
    first=st.integers(-80_000, 800_000).map(lambda eighth: eighth / 8),
    length=st.sampled_from([1.0, 2.5, 12.0, 24.0, 250.0]),
    size=st.sampled_from([1e-6, 1e-3, 0.1, 2.0]),
    zero_ends=st.booleans(),
)
def test_any_polynomial_is_followed(seed, degree, first, length, size, zero_ends):
    """Within the tolerance, or what products of so many factors leave of values of this size."""
    series = smooth(seed, degree, size, zero_ends=zero_ends)
    assert error(carried(series, first, first + length), series, first, first + length) <= max(TOLERANCE, 5e-6 * size)


@pytest.mark.blender
def test_blender_evaluates_terms_to_the_last_bit_alike():
    bpy = pytest.importorskip("bpy")
    action = bpy.data.actions.new("Measured")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    bag = strip.channelbag(action.slots.new("OBJECT", "Measured"), ensure=True)
    try:
        for index, (first, degree) in enumerate([(1.0, 5), (3000.0, 12), (100_000.0, 4)]):
            fcurve = bag.fcurves.new("location", index=index)
            fcurve.keyframe_points.insert(first, 0.0)
            terms = carried(smooth(degree, degree), first, first + 30.0)
            for number, term in enumerate(terms):
                modifier = fcurve.modifiers.new("GENERATOR")
                modifier.name = f"Term {number}"
                modifier.mode, modifier.use_additive = "POLYNOMIAL_FACTORISED", True
                modifier.poly_order = len(term.coefficients) // 2
                modifier.coefficients = term.coefficients
                modifier.use_restricted_range, modifier.frame_start, modifier.frame_end = True, term.first, term.last
            frames = np.concatenate([[first - 1.0], frames_of(first, first + 30.0), [first + 31.0]])
            assert [fcurve.evaluate(frame) for frame in frames] == evaluate(terms, frames).tolist()
    finally:
        bpy.data.actions.remove(action)
