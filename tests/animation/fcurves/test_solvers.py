"""Bezier segments as cubics, and the parameter that belongs to a time, by what is known of them without Blender."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.animation.fcurves.solvers import solve_cubics

T = np.linspace(0.0, 1.0, 1001)

lengths = st.integers(0, 64).map(lambda number: number / 64.0)


def cubics_from(handles: np.ndarray) -> np.ndarray:
    """Cubics (3, k) from 0 to 1 whose handles (k, 2) are so long, as a share of the segment."""
    first, second = np.asarray(handles, np.float64).T
    return np.stack((3.0 * first, 3.0 * (1.0 - second - 2.0 * first), 3.0 * first + 3.0 * second - 2.0))


def time_of(cubic: np.ndarray, t: np.ndarray) -> np.ndarray:
    return ((cubic[2] * t + cubic[1]) * t + cubic[0]) * t


@given(lengths, lengths)
def test_solving_finds_the_parameter_of_every_time(first, second):
    cubic = np.repeat(cubics_from([(first, second)]), len(T), axis=1)
    t = solve_cubics(T, cubic)
    assert np.all((t > -1e-5) & (t < 1.0 + 1e-5))
    np.testing.assert_allclose(time_of(cubic, t), T, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    "handles", [(1.0, 1.0), (0.0, 0.0), (0.0, 1.0), (1.0, 0.0)], ids=["level in the middle", "steep", "left", "right"]
)
def test_times_at_which_the_curve_is_level_are_solved_too(handles):
    u = np.concatenate((T, 0.5 + np.array((-1e-3, -1e-6, -1e-9, 0.0, 1e-9, 1e-6, 1e-3))))
    cubic = np.repeat(cubics_from([handles]), len(u), axis=1)
    np.testing.assert_allclose(time_of(cubic, solve_cubics(u, cubic)), u, rtol=0.0, atol=1e-9)
