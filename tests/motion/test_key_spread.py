"""Keys of a budget, laid out and moved, against all that there are to choose from."""

import itertools

import numpy as np
import pytest

from rigid_motion.motion.key_costs import Costs, Recording
from rigid_motion.motion.key_spread import HALVINGS, RAISED, SHARPNESS, WAYS, moved_together, spread_keys
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


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("mode", "ways"), [("lerp_slerp", 5), ("dq_sclerp", 2), ("motor_spline", 3)])
def test_keys_are_moved_to_the_best_of_all_choices(mode, ways, seed):
    costs, keys = costs_of(60, mode, seed), np.array((0, 11, 25, 33, 47, 59))
    _, peak = costs.of_keys(keys)
    step = np.where(peak[1:] < peak[:-1], -1, 1)

    def cost(samples: np.ndarray) -> float:
        return float(((costs.of_keys(samples)[1] / peak.max()) ** SHARPNESS).sum())

    choices = keys[1:-1, None] + step[:, None] * WAYS[:ways]
    least = min(cost(np.array((0, *inner, 59))) for inner in itertools.product(*choices.tolist()))
    moved = moved_together(costs, keys, ways, 12)
    assert (moved[0], moved[-1]) == (0, 59)
    assert cost(moved) == pytest.approx(least)
    assert least < cost(keys)
