"""Tests that the search's fast errors of splines are the errors of the mode."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import Poses, key_splines
from rigid_motion.motion.key_costs import Costs, SampleTracks
from tests.motion.bodies import RADIUS, shell_errors, wandering


def errors_of(times: np.ndarray, poses: Poses, keys: np.ndarray) -> np.ndarray:
    costs = Costs(SampleTracks(times, poses, "motor_spline", RADIUS), 8)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(keys, 1, constant_values=-1), 4)
    return costs.errors(windows)


@pytest.mark.parametrize("remembered", [key_splines.REMEMBERED_EACH, 0])
@pytest.mark.parametrize("seed", range(2))
def test_errors_are_those_of_the_mode(seed, remembered, monkeypatch):
    monkeypatch.setattr(key_splines, "REMEMBERED_EACH", remembered)
    times, poses = wandering(400, seed, 1e-4 * (seed % 2))
    random = np.random.default_rng(seed)
    for count in (2, 3, 5, 20, 100):
        keys = np.sort(random.choice(np.arange(1, 399), count - 2, replace=False))
        keys = np.concatenate(((0,), keys, (399,)))
        errors = errors_of(times, poses, keys)
        assert np.allclose(errors, shell_errors(times, poses, keys, "motor_spline"), rtol=1e-9, atol=1e-9)
