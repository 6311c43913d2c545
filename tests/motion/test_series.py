"""Power series: where there are many samples they stand for the curve, and nobody can tell."""

import numpy as np
import pytest

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import align_signs
from tests.motion.cases import random_quaternions


@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
@pytest.mark.parametrize("uneven", [0.0, 0.5, 1.5])
@pytest.mark.parametrize("seed", range(4))
def test_many_samples_of_a_spline_are_what_few_are(seed, uneven, scaled):
    random = np.random.default_rng(seed)
    times = np.cumsum(np.exp(uneven * random.normal(size=12)))
    scales = np.exp(random.normal(size=12)) if scaled else None
    keys = Poses(10.0 * random.normal(size=(12, 3)), align_signs(random_quaternions(random, 12)), scales)
    moments = np.linspace(times[0], times[-1], 60_000)
    some = np.sort(random.choice(len(moments), 400, replace=False))
    many, few = (
        interpolate(times, keys, moments, "motor_spline"),
        interpolate(times, keys, moments[some], "motor_spline"),
    )
    np.testing.assert_allclose(many.positions[some], few.positions, rtol=0, atol=1e-13 * np.abs(keys.positions).max())
    np.testing.assert_allclose(many.quaternions[some], few.quaternions, rtol=0, atol=1e-13)
    if scaled:
        np.testing.assert_allclose(many.scales[some], few.scales, rtol=1e-13, atol=0)
