"""Keys of a budget, laid out and moved, against all that there are to choose from."""

import itertools

import numpy as np
import pytest

from rigid_motion.motion.key_costs import Costs, Recording
from rigid_motion.motion.key_spread import HALVINGS, RAISED, spread_keys
from tests.motion.test_reduction import RADIUS, wandering


def costs_of(count: int, mode: str, seed: int) -> Costs:
    times, poses = wandering(count, seed, 0.01, 40.0)
    return Costs(Recording(times, poses, mode, RADIUS), 8)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp"])
def test_keys_are_laid_out_as_well_as_any_but_for_the_last_step(mode, seed):
    costs = costs_of(14, mode, seed)
    ways = [np.array((0, *inner, 13)) for inner in itertools.combinations(range(1, 13), 3)]
    peaks = [costs.peak(way) for way in ways]
    keys, is_complete = spread_keys(costs, np.arange(14), ways[int(np.argmax(peaks))], 5)
    assert is_complete
    assert len(keys) <= 5
    assert costs.peak(keys) <= min(peaks) * RAISED ** (0.5**HALVINGS) * (1.0 + 1e-9)
