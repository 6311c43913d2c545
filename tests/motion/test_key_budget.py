"""Keys of a budget: what is done with those that are left."""

from __future__ import annotations

import pytest

from rigid_motion.motion import reduce_keys
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
