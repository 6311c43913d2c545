"""Keys of a budget: what is done with those that are left."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import MODES, reduce_keys
from rigid_motion.motion.key_budget import BudgetSearch
from rigid_motion.motion.key_costs import Recording
from tests.motion.test_reduction import RADIUS, wandering


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "motor_spline"])
def test_keys_that_are_put_in_do_not_make_the_error_larger(mode, seed):
    times, poses = wandering(300, seed)
    keys = reduce_keys(times, poses, mode, 0.02, RADIUS)
    search = BudgetSearch(Recording(times, poses, mode, RADIUS), len(keys) + 4)
    before = search.measured(keys)
    filled = search.filled(before)
    assert len(filled.indices) == len(keys) + 4
    assert filled.peak.max() <= before.peak.max()


@pytest.mark.parametrize("rms", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_a_body_at_rest_has_two_keys_whatever_the_budget(mode, rms):
    times, poses = wandering(100, 0)
    still = poses[np.zeros(100, dtype=int)]
    assert reduce_keys(times, still, mode, radius=RADIUS, budget=30, rms=rms).tolist() == [0, 99]
