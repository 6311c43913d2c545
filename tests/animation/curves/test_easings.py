"""Easings by what is known of them without Blender; `test_evaluation.py` compares them with Blender's own."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.animation.curves.easings import EASE_IN, ease, elastic

U = np.linspace(0.0, 1.0, 1001)
EASINGS = ("AUTO", "EASE_IN", "EASE_OUT", "EASE_IN_OUT")


@pytest.mark.parametrize("easing", EASINGS)
@pytest.mark.parametrize("interpolation", EASE_IN)
def test_an_easing_goes_from_0_to_1(interpolation, easing):
    np.testing.assert_allclose(ease(interpolation, easing, U[[0, -1]], 1.7), (0.0, 1.0), atol=1e-15)


@pytest.mark.parametrize("interpolation", EASE_IN)
def test_easing_out_is_easing_in_turned_about_the_middle(interpolation):
    eased_in, out = (ease(interpolation, easing, U, 1.7) for easing in ("EASE_IN", "EASE_OUT"))
    np.testing.assert_allclose(out, 1.0 - eased_in[::-1], atol=1e-12)
    assert not np.allclose(out, eased_in)


@pytest.mark.parametrize("interpolation", EASE_IN)
def test_easing_in_and_out_is_symmetrical(interpolation):
    values = ease(interpolation, "EASE_IN_OUT", U, 1.7)
    np.testing.assert_allclose(values, 1.0 - values[::-1], atol=1e-12)


@pytest.mark.parametrize("interpolation", EASE_IN)
def test_automatic_easing_overshoots_and_bounces_at_the_end_and_else_is_slow_at_the_start(interpolation):
    easing = "EASE_OUT" if interpolation in ("BACK", "BOUNCE") else "EASE_IN"
    np.testing.assert_array_equal(ease(interpolation, "AUTO", U, 1.7), ease(interpolation, easing, U, 1.7))


@pytest.mark.parametrize(
    ("interpolation", "middle"),
    [
        ("SINE", 1.0 - np.sqrt(0.5)),
        ("QUAD", 1 / 4),
        ("CUBIC", 1 / 8),
        ("QUART", 1 / 16),
        ("QUINT", 1 / 32),
        ("EXPO", 31 / 1023),
        ("CIRC", 1.0 - np.sqrt(0.75)),
    ],
)
def test_easing_in_is_where_its_name_says_half_way(interpolation, middle):
    np.testing.assert_allclose(ease(interpolation, "EASE_IN", np.array([0.5])), middle, rtol=1e-14)


def test_an_overshoot_of_1_7_is_a_tenth_of_the_way():
    assert np.max(ease("BACK", "EASE_OUT", U, 1.70158)) == pytest.approx(1.1, abs=1e-4)


def test_a_ball_bounces_three_times_ever_lower():
    height = 1.0 - ease("BOUNCE", "EASE_OUT", np.linspace(0.0, 1.0, 100001))
    peaks = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])) + 1
    np.testing.assert_allclose(height[peaks], (1 / 4, 1 / 16, 1 / 64), atol=1e-8)
    assert np.min(height) >= -1e-12


@pytest.mark.parametrize("easing", EASINGS)
@pytest.mark.parametrize("amplitude", [0.0, 0.3, 1.0, 2.5])
@pytest.mark.parametrize("change", [2.0, -2.0])
def test_elastic_goes_from_0_to_the_change(easing, amplitude, change):
    np.testing.assert_allclose(elastic(easing, U[[0, -1]], change, amplitude, 0.0), (0.0, change), atol=1e-12)


def test_elastic_swings_about_the_end_with_the_period_asked_for():
    u = 0.003 + U[:-10]
    beyond = elastic("EASE_OUT", u, 1.0, 1.0, 0.2) > 1.0
    np.testing.assert_allclose(np.diff(u[1:][beyond[1:] != beyond[:-1]]), 0.1, atol=1.5e-3)


def test_the_larger_the_amplitude_the_larger_the_swing():
    swings = [np.ptp(elastic("EASE_OUT", U, 1.0, amplitude, 0.2)[100:]) for amplitude in (0.2, 0.5, 1.0, 2.0, 4.0)]
    assert np.all(np.diff(swings) > 0.0)


def test_what_does_not_change_does_not_swing_unless_it_is_given_an_amplitude():
    assert not np.any(elastic("EASE_OUT", U, 0.0, 0.0, 0.2))
    assert np.ptp(elastic("EASE_OUT", U, 0.0, 1.0, 0.2)) > 0.5


def test_each_moment_may_have_its_own_settings():
    changes, amplitudes, backs = np.array([1.0, -2.0, 0.0]), np.array([0.5, 3.0, 0.0]), np.array([0.0, 1.7, -1.0])
    u = np.array([0.2, 0.6, 0.9])
    own = [elastic("AUTO", u[[i]], *row, 0.0)[0] for i, row in enumerate(zip(changes, amplitudes, strict=True))]
    np.testing.assert_array_equal(elastic("AUTO", u, changes, amplitudes, 0.0), own)
    own = [ease("BACK", "AUTO", u[[i]], back)[0] for i, back in enumerate(backs)]
    np.testing.assert_array_equal(ease("BACK", "AUTO", u, backs), own)
