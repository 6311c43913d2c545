"""What segments between keys cost, recomputed apart from the search."""

import pytest

from rigid_motion.motion import key_costs, key_search, reduce_keys
from tests.motion.test_reduction import RADIUS, wandering

TOLERANCE = 0.02


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "motor_spline_causal"])
def test_keys_are_the_same_whatever_is_remembered_or_put_off(mode, monkeypatch):
    times, poses = wandering(200, 7, 0.001)
    keys = reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist()
    monkeypatch.setattr(key_costs, "REMEMBERED", 10)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys
    monkeypatch.setattr(key_search, "MUCH", 0)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys
