"""Handles with which Bezier segments run through given values."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rigid_motion.animation.fcurves.solvers import fit_together
from tests.thoroughness import tried

TIMES = np.linspace(0.0, 1.0, 41)


def values_of(handles: np.ndarray, times: np.ndarray) -> np.ndarray:
    """A segment from (0, 0) to (1, 1), by bisection on its time."""
    points = np.stack(((0.0, 0.0), *handles, (1.0, 1.0)))
    low, high = np.zeros_like(times), np.ones_like(times)
    for _ in range(60):
        t = 0.5 * (low + high)
        late = _bezier(points, t)[:, 0] > times
        low, high = np.where(late, low, t), np.where(late, t, high)
    return _bezier(points, low)[:, 1]


def _bezier(points: np.ndarray, t: np.ndarray) -> np.ndarray:
    level = [np.repeat(point[None], len(t), axis=0) for point in points]
    while len(level) > 1:
        level = [one + t[:, None] * (other - one) for one, other in itertools.pairwise(level)]
    return level[0]


@pytest.mark.parametrize(
    "handles",
    [
        ((1 / 3, 0.0), (2 / 3, 1.0)),
        ((0.39, 0.0), (0.61, 1.0)),
        ((0.8, 0.0), (0.9, 1.0)),
        ((0.1, 0.7), (0.6, 1.3)),
        ((0.0, 0.0), (1.0, 1.0)),
        ((0.5, -0.6), (0.5, 1.6)),
        ((0.9, 0.1), (0.2, 0.8)),
    ],
)
def test_one_segment_is_recovered(handles):
    handles = np.array(handles)
    result = fit_together(TIMES, values_of(handles, TIMES), np.array((1.0,)), handles[None, :, 0])[0]
    often = np.linspace(0.0, 1.0, 333)
    assert np.abs(values_of(result, often) - values_of(handles, often)).max() < 1e-4
    assert np.all((result[:, 0] >= 0.0) & (result[:, 0] <= 1.0))


def test_what_no_single_segment_is_can_be_the_mean_of_several():
    random = np.random.default_rng(1)
    errors = []
    for _ in range(tried(20)):
        x = np.sort(random.uniform(0.05, 0.95, size=(4, 2)), axis=1)
        handles = np.stack((x, random.normal(0.5, 0.5, size=(4, 2))), axis=2)
        old, new = random.dirichlet((2.0,) * 4, size=2)
        values = sum(share * values_of(each, TIMES) for share, each in zip(old, handles, strict=True))
        result = fit_together(TIMES, values, new, x)
        mean = sum(share * values_of(each, TIMES) for share, each in zip(new, result, strict=True))
        errors.append(np.abs(mean - values).max())
    assert max(errors) < 2e-4


def test_what_is_a_cubic_in_time_on_top_of_a_segment_is_the_mean_of_one_and_the_other():
    segment, in_time = np.array(((0.39, 0.2), (0.61, 0.7))), np.array(((1 / 3, 0.5), (2 / 3, 1.1)))
    values = 0.5 * (values_of(segment, TIMES) + values_of(in_time, TIMES))
    result = fit_together(TIMES, values, np.array((0.6, 0.4)), np.array((segment[:, 0],) * 2))
    mean = 0.6 * values_of(result[0], TIMES) + 0.4 * values_of(result[1], TIMES)
    assert np.abs(mean - values).max() < 1e-4
