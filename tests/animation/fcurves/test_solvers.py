"""Bezier segments: the parameter for a given time, and handles fitted to given values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rigid_motion.animation.fcurves.solvers import fit_together, solve_cubics
from tests.animation.fcurves.examples import evaluate_one, keys_of
from tests.thoroughness import tried

pytestmark = pytest.mark.any_blender

NEAR_LEVEL = 0.5 + np.array((-1e-3, -1e-6, -1e-9, 1e-9, 1e-6, 1e-3))
T, TIMES = np.concatenate((np.linspace(0.0, 1.0, 1001), NEAR_LEVEL)), np.linspace(0.0, 1.0, 41)

lengths = st.integers(0, 64).map(lambda number: number / 64.0)


@given(lengths, lengths)
@example(1.0, 1.0)
@example(0.0, 0.0)
@example(0.0, 1.0)
@example(1.0, 0.0)
def test_solving_finds_the_parameter_of_every_time(first, second):
    """The handles have these lengths, as fractions of the segment."""
    c1, c2, c3 = 3.0 * first, 3.0 * (1.0 - second - 2.0 * first), 3.0 * first + 3.0 * second - 2.0
    t = solve_cubics(T, np.array((c1, c2, c3))[:, None].repeat(len(T), axis=1))
    assert np.all((t > -1e-5) & (t < 1.0 + 1e-5))
    np.testing.assert_allclose(((c3 * t + c2) * t + c1) * t, T, rtol=0.0, atol=1e-9)


def segment(handles: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the values of a segment from (0, 0) to (1, 1)."""
    first, last = handles
    return evaluate_one(keys_of((0, 1), (0, 1), "BEZIER", left=((0, 0), last), right=(first, (1, 1))), times)


def mean(shares: np.ndarray, handles: np.ndarray, times: np.ndarray) -> np.ndarray:
    return sum(share * segment(each, times) for share, each in zip(shares, handles, strict=True))


ONES = (
    ((1 / 3, 0.0), (2 / 3, 1.0)),
    ((0.39, 0.0), (0.61, 1.0)),
    ((0.8, 0.0), (0.9, 1.0)),
    ((0.1, 0.7), (0.6, 1.3)),
    ((0.0, 0.0), (1.0, 1.0)),
    ((0.5, -0.6), (0.5, 1.6)),
    ((0.9, 0.1), (0.2, 0.8)),
)


def test_one_segment_is_recovered_and_what_none_is_can_be_the_mean_of_several():
    random = np.random.default_rng(1)
    curved_and_in_time = np.array((((0.39, 0.2), (0.61, 0.7)), ((1 / 3, 0.5), (2 / 3, 1.1))))
    cases = [(curved_and_in_time, np.array((0.5, 0.5)), np.array((0.6, 0.4)), curved_and_in_time[[0, 0], :, 0], 1e-4)]
    for handles in ONES:
        handles = np.array((handles,))
        cases.append((handles, np.ones(1), np.ones(1), handles[..., 0], 1e-4))
    for _ in range(tried(20)):
        x = np.sort(random.uniform(0.05, 0.95, size=(4, 2)), axis=1)
        handles = np.stack((x, random.normal(0.5, 0.5, size=(4, 2))), axis=2)
        cases.append((handles, *random.dirichlet((2.0,) * 4, size=2), x, 2e-4))
    for handles, old, new, x, tolerance in cases:
        values = mean(old, handles, TIMES)
        result = fit_together(TIMES, values, new, x)
        assert np.abs(mean(new, result, TIMES) - values).max() < tolerance
        assert np.all((result[..., 0] >= 0.0) & (result[..., 0] <= 1.0))
