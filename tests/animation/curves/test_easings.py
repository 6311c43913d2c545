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


@pytest.mark.parametrize("easing", EASINGS)
@pytest.mark.parametrize("amplitude", [0.0, 0.3, 1.0, 2.5])
@pytest.mark.parametrize("change", [2.0, -2.0])
def test_elastic_goes_from_0_to_the_change(easing, amplitude, change):
    np.testing.assert_allclose(elastic(easing, U[[0, -1]], change, amplitude, 0.0), (0.0, change), atol=1e-12)


def test_each_moment_may_have_its_own_settings():
    changes, amplitudes, backs = np.array([1.0, -2.0, 0.0]), np.array([0.5, 3.0, 0.0]), np.array([0.0, 1.7, -1.0])
    u = np.array([0.2, 0.6, 0.9])
    own = [elastic("AUTO", u[[i]], *row, 0.0)[0] for i, row in enumerate(zip(changes, amplitudes, strict=True))]
    np.testing.assert_array_equal(elastic("AUTO", u, changes, amplitudes, 0.0), own)
    own = [ease("BACK", "AUTO", u[[i]], back)[0] for i, back in enumerate(backs)]
    np.testing.assert_array_equal(ease("BACK", "AUTO", u, backs), own)
