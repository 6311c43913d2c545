"""Tests of piecewise functions: prepared or not, and by power series for many samples, they agree."""

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, in_betweens, interpolate, prepare
from rigid_motion.motion.quaternions import align_signs
from tests.motion.cases import assert_same, random_quaternions


@pytest.mark.parametrize("mode", MODES)
def test_a_segment_without_samples_may_lie_between_long_ones(mode):
    random = np.random.default_rng(2)
    keys = Poses(random.normal(size=(4, 3)), random_quaternions(random, 4))
    u = np.linspace(0.0, 1.0, 50_000)
    both = in_betweens(np.arange(4.0), keys, [50_000, 0, 50_000], np.concatenate((u, u)), mode)
    for place, some in ((0, slice(0, 50_000)), (2, slice(50_000, None))):
        counts = np.zeros(3, dtype=int)
        counts[place] = 50_000
        alone = in_betweens(np.arange(4.0), keys, counts, u, mode)
        assert_same(both[some], alone)


@pytest.mark.parametrize("mode", MODES)
def test_prepared_segments_give_the_same_a_few_at_a_time_and_past_their_keys(mode):
    random = np.random.default_rng(3)
    keys = Poses(random.normal(size=(2, 5, 3)), random_quaternions(random, 10).reshape(2, 5, 4), np.full((2, 5), 1.5))
    times, counts = np.arange(5.0), np.array(((3, 0, 2, 4), (5, 1, 0, 2)))
    progress = random.uniform(-0.3, 1.3, size=counts.sum())
    expected = in_betweens(times, keys, counts, progress, mode)
    segments = prepare(times, keys, mode)
    bounds = np.concatenate(((0,), np.cumsum(counts)))
    for first, last in ((0, 3), (3, 6), (6, 8)):
        samples = slice(bounds[first], bounds[last])
        few = segments(counts.ravel()[first:last], progress[samples], slice(first, last))
        assert_same(few, expected[samples])


def test_prepared_segments_refuse_what_does_not_fit_them():
    segments = prepare([0.0, 1.0, 2.0], Poses(np.zeros((3, 3)), np.tile((1.0, 0.0, 0.0, 0.0), (3, 1))))
    with pytest.raises(ValueError, match="do not fit"):
        segments([1, 1], [0.5, 0.5], slice(1, 2))
    with pytest.raises(ValueError, match="finite"):
        segments([1], [np.nan], slice(1, 2))


@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
@pytest.mark.parametrize("uneven", [0.0, 0.5, 1.5])
@pytest.mark.parametrize("seed", range(2))
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
