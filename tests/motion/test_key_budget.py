"""Keys of a budget: what is done with those that are left."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import MODES, reduce_keys
from tests.motion.test_reduction import RADIUS, wandering


@pytest.mark.parametrize("rms", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_a_body_at_rest_has_two_keys_whatever_the_budget(mode, rms):
    times, poses = wandering(100, 0)
    still = poses[np.zeros(100, dtype=int)]
    assert reduce_keys(times, still, mode, radius=RADIUS, budget=30, rms=rms).tolist() == [0, 99]
