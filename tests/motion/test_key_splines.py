"""The quick errors of splines for the search are those of the mode."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import Poses, interpolate, key_splines
from rigid_motion.motion.key_costs import Costs, Recording
from tests.motion.test_reduction import RADIUS, shell_errors, wandering


def errors_of(times: np.ndarray, poses: Poses, keys: np.ndarray) -> np.ndarray:
    costs = Costs(Recording(times, poses, "motor_spline", RADIUS), 8)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(keys, 1, constant_values=-1), 4)
    return costs.errors(windows)


@pytest.mark.parametrize("remembered", [key_splines.REMEMBERED_EACH, 0])
@pytest.mark.parametrize("seed", range(5))
def test_errors_are_those_of_the_mode(seed, remembered, monkeypatch):
    monkeypatch.setattr(key_splines, "REMEMBERED_EACH", remembered)
    times, poses = wandering(400, seed, 1e-4 * (seed % 2))
    random = np.random.default_rng(seed)
    for count in (2, 3, 5, 20, 100):
        keys = np.sort(random.choice(np.arange(1, 399), count - 2, replace=False))
        keys = np.concatenate(((0,), keys, (399,)))
        errors = errors_of(times, poses, keys)
        assert np.allclose(errors, shell_errors(times, poses, keys, "motor_spline"), rtol=1e-9, atol=1e-9)


def test_errors_beside_a_rest_are_those_of_the_mode():
    times, poses = wandering(120, 3)
    rests = np.concatenate((np.arange(60), np.full(40, 60), np.arange(60, 120)))
    times, poses = np.arange(len(rests)) / 60.0, poses[rests]
    keys = np.array((0, 20, 62, 75, 90, 110, 140, 159))
    assert np.allclose(errors_of(times, poses, keys), shell_errors(times, poses, keys, "motor_spline"), atol=1e-9)
    shown = interpolate(times[keys], poses[keys], times[62:91], "motor_spline")
    assert np.ptp(shown.positions, axis=0).max() == 0.0
