"""What segments between keys cost, recomputed apart from the search."""

import numpy as np
import pytest

from rigid_motion.motion import MODES, key_costs, key_search, reduce_keys
from rigid_motion.motion.key_costs import Costs, Recording
from tests.motion.test_reduction import RADIUS, shell_errors, wandering

TOLERANCE = 0.02


@pytest.mark.parametrize("mode", MODES)
def test_the_costs_of_keys_are_sums_of_powers_of_the_errors_between_them(mode):
    times, poses = wandering(120, 3, 0.01)
    keys = np.unique(np.append(np.random.default_rng(5).choice(120, 12, replace=False), (0, 119)))
    costs = Costs(Recording(times, poses, mode, RADIUS, TOLERANCE), 8)
    ended = np.pad(keys, costs.reach, constant_values=-1)
    cost, peak = costs.of(np.lib.stride_tricks.sliding_window_view(ended, costs.keys))
    errors = shell_errors(times, poses, keys, mode) / TOLERANCE
    errors[keys] = 0.0
    assert cost == pytest.approx(np.add.reduceat(errors**8, keys[:-1]), rel=1e-6, abs=1e-30)
    assert peak == pytest.approx(np.maximum.reduceat(errors, keys[:-1]), rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "motor_spline_causal"])
def test_keys_are_the_same_whatever_is_remembered_or_put_off(mode, monkeypatch):
    times, poses = wandering(200, 7, 0.001)
    keys = reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist()
    monkeypatch.setattr(key_costs, "REMEMBERED", 10)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys
    monkeypatch.setattr(key_search, "MUCH", 0)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys
