"""Tests of sines and cosines by the half-angle tangent and by the polynomial, whichever suits the processor."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rigid_motion.motion import Poses, interpolate, trigonometry
from rigid_motion.motion.trigonometry import MAX_NARROW_RAD, fill_sine_and_cosine

both_ways = pytest.mark.parametrize("vector_tangent", [False, True], ids=["polynomial", "tangent"])


def _sine_and_cosine(angles: np.ndarray, narrow: bool) -> tuple[np.ndarray, np.ndarray]:
    sine, cosine = np.full((2, len(angles)), np.nan)
    fill_sine_and_cosine(angles, sine, cosine, narrow=narrow)
    return sine, cosine


def _is_exact(angles: np.ndarray, narrow: bool) -> bool:
    """Return whether sines match the C library to three units in the last place, and cosines to two of those of 1.

    Sines may be off by as many more units as NumPy's own tangent is beyond one: before NumPy 2 that is up to three on
    processors with AVX-512.
    """
    sine, cosine = _sine_and_cosine(angles, narrow)
    expected = np.array([math.sin(angle) for angle in angles])
    tangent = np.array([math.tan(0.5 * angle) for angle in angles])
    units = np.abs(np.tan(0.5 * angles) - tangent) / np.spacing(np.abs(tangent))
    allowed = 2.0 + max(1.0, float(units.max()))
    return bool(
        np.all(np.abs(sine - expected) <= allowed * np.spacing(np.abs(expected)))
        and np.all(np.abs(cosine - [math.cos(angle) for angle in angles]) <= 2.0 * np.spacing(1.0))
    )


@both_ways
def test_angles_have_their_sines_and_cosines_to_a_few_units_in_the_last_place(monkeypatch, vector_tangent):
    monkeypatch.setattr(trigonometry, "VECTOR_TANGENT", vector_tangent)
    random = np.random.default_rng(4)
    for narrow in (
        random.uniform(-MAX_NARROW_RAD, MAX_NARROW_RAD, size=20000),
        10.0 ** random.uniform(-300.0, 0.0, size=2000),
        np.array([0.0, -MAX_NARROW_RAD, MAX_NARROW_RAD, np.pi / 4.0, 5e-324]),
    ):
        assert _is_exact(narrow, narrow=True)
    assert _is_exact(random.uniform(-4.0 * np.pi, 4.0 * np.pi, size=20000), narrow=False)
    assert _is_exact(random.uniform(-1e6, 1e6, size=2000), narrow=False)


@pytest.mark.parametrize("turns", [1, -1, 3, 1001])
def test_half_a_turn_is_no_pole(turns):
    """At half a turn the half-angle tangent has its pole, which no double hits exactly."""
    angle = turns * np.pi
    around = np.array([np.nextafter(angle, -np.inf), angle, np.nextafter(angle, np.inf)])
    assert _is_exact(around, narrow=False)
    sine, cosine = _sine_and_cosine(around, narrow=False)
    assert np.all(cosine == -1.0)
    assert np.all(sine != 0.0)


def test_without_a_word_from_numpy_the_polynomial_is_taken(monkeypatch):
    monkeypatch.setattr(np.lib, "introspect", SimpleNamespace(opt_func_info=lambda **_: {}), raising=False)
    assert not trigonometry._has_vector_tangent()
    monkeypatch.delattr(np.lib, "introspect")
    assert not trigonometry._has_vector_tangent()


@both_ways
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_far_outside_of_the_keys_the_turn_goes_on(mode, monkeypatch, vector_tangent):
    """More than three whole turns: psi passes pi / 2 and pi, where the tangent of psi / 2 jumps."""
    monkeypatch.setattr(trigonometry, "VECTOR_TANGENT", vector_tangent)
    half = np.radians(50.0)
    keys = Poses(
        [[1.0, 0.0, 0.0], [np.cos(2 * half), np.sin(2 * half), 0.5]], [[1, 0, 0, 0], [np.cos(half), 0, 0, np.sin(half)]]
    )
    times = np.concatenate((np.linspace(-12.0, 12.0, 4801), (np.pi / half) * np.arange(-6, 7) + 0.5))
    shown = interpolate([0.0, 1.0], keys, times, mode, extrapolate=True)
    zero = np.zeros_like(times)
    turned = np.stack((np.cos(times * half), zero, zero, np.sin(times * half)), axis=1)
    np.testing.assert_allclose(shown.quaternions, turned, rtol=0.0, atol=1e-14)
    if mode != "lerp_slerp":
        path = np.stack((np.cos(2.0 * times * half), np.sin(2.0 * times * half), 0.5 * times), axis=1)
        np.testing.assert_allclose(shown.positions, path, rtol=0.0, atol=1e-13)
