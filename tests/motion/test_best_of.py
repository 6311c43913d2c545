"""Tests of the best mode per segment: never worse than a single mode, right in known cases, no needless changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import (
    KEYFRAME_MODES,
    Poses,
    best_modes,
    decimate,
    interpolate,
    interpolate_by_segments,
    reduce_keys,
)
from rigid_motion.motion.best_of import least_errors
from tests.motion.bodies import RADIUS, shell_errors, wandering
from tests.motion.cases import assert_same, random_quaternions
from tests.thoroughness import tried


def errors_by_segments(times, poses, keys, modes) -> np.ndarray:
    """Return the shell error of a mixed motion at all samples from the first key to the last, by matrices."""
    errors = {mode: shell_errors(times, poses, keys, mode) for mode in set(modes)}
    return np.concatenate(
        [
            errors[mode][first : last + (last == keys[-1])]
            for first, last, mode in zip(keys[:-1], keys[1:], modes, strict=True)
        ]
    )


@settings(max_examples=tried(60))
@given(
    st.integers(3, 200),
    st.integers(0, 2**16),
    st.sampled_from((0.0, 1e-3)),
    st.lists(st.sampled_from(tuple(KEYFRAME_MODES)), min_size=1, max_size=5, unique=True),
    st.data(),
)
def test_it_is_never_further_off_than_any_of_its_modes(count, seed, noise, modes, data):
    times, poses = wandering(count, seed, noise)
    inner = data.draw(st.lists(st.integers(1, count - 2), unique=True, max_size=20))
    keys = np.array(sorted({0, count - 1, *inner}))
    chosen = best_modes(times, poses, keys, modes, RADIUS)
    assert len(chosen) == len(keys) - 1
    assert set(chosen) <= set(modes)
    squares = np.sum(errors_by_segments(times, poses, keys, chosen) ** 2)
    for mode in modes:
        assert np.sqrt(squares) <= np.sqrt(np.sum(shell_errors(times, poses, keys, mode) ** 2)) * (1.0 + 2e-6) + 1e-9


@settings(max_examples=tried(40))
@given(st.integers(3, 120), st.integers(0, 2**16), st.booleans(), st.data())
def test_what_is_shown_is_in_each_segment_what_its_mode_shows(count, seed, scaled, data):
    random = np.random.default_rng(seed)
    key_times = np.cumsum(random.uniform(0.1, 1.0, 6))
    scales = random.uniform(0.5, 2.0, 6) if scaled else None
    keys = Poses(random.normal(size=(6, 3)), random_quaternions(random, 6), scales)
    modes = data.draw(st.lists(st.sampled_from(tuple(KEYFRAME_MODES)), min_size=5, max_size=5))
    times = random.uniform(key_times[0] - 0.5, key_times[-1] + 0.5, count)
    shown = interpolate_by_segments(key_times, keys, times, modes)
    segment = np.clip(np.searchsorted(key_times, times, side="right") - 1, 0, 4)
    for number, mode in enumerate(modes):
        here = segment == number
        if here.any():
            assert_same(shown[here], interpolate(key_times, keys, times, mode)[here])


def test_modes_that_are_one_motion_are_not_told_apart_by_rounding():
    times, poses = wandering(400, 3)
    keys = decimate(times, 8.0)
    one = ("dq_sclerp", "pga_slerp", "cga_slerp")
    screws = interpolate(times[keys], poses[keys], times, "dq_sclerp")
    for order in (one, one[::-1]):
        assert set(best_modes(times, poses, keys, order, RADIUS)) == {order[0]}
        assert set(best_modes(times, screws, keys, ("lerp_slerp", *order, "motor_spline"), RADIUS)) == {order[0]}


@settings(max_examples=tried(100))
@given(st.integers(1, 5), st.integers(1, 9), st.integers(0, 2**16))
def test_no_choice_of_equally_good_modes_has_fewer_changes(modes, segments, seed):
    random = np.random.default_rng(seed)
    shown = np.zeros((modes, 2 * segments + 1))
    shown[:, 1::2] = random.integers(1, 3, (modes, segments))
    chosen = least_errors(shown, np.arange(0, 2 * segments + 1, 2))
    costs = shown[:, 1::2]
    assert np.array_equal(costs[chosen, np.arange(segments)], costs.min(axis=0))
    # The fewest changes, by dynamic programming: the fewest that lead to each mode, segment by segment.
    fewest = np.where(costs[:, 0] == costs[:, 0].min(), 0.0, np.inf)
    for cost in costs.T[1:]:
        fewest = np.where(cost == cost.min(), np.minimum(fewest, fewest.min() + 1.0), np.inf)
    assert np.count_nonzero(np.diff(chosen)) == fewest.min()


@pytest.mark.parametrize(("tolerance", "mode"), [(0.01, "motor_spline"), (0.01, "lerp_slerp"), (0.01, "dq_sclerp")])
def test_a_segment_at_the_very_tolerance_does_not_fall_for_a_mode_that_passes_it(tolerance, mode):
    """Another mode may be nearer on the whole but exceed the tolerance. The keys' own mode may do so by rounding."""
    for seed in range(16):
        times, poses = wandering(300, seed)
        keys = reduce_keys(times, poses, mode, tolerance, RADIUS, tries=0)
        largest = shell_errors(times, poses, keys, mode).max()
        free, bound = (
            errors_by_segments(times, poses, keys, best_modes(times, poses, keys, KEYFRAME_MODES, RADIUS, most)).max()
            for most in (None, largest * (1.0 - 1e-13))
        )
        assert bound <= tolerance * (1.0 + 1e-9)
        if free > 1.02 * tolerance:
            return
    pytest.fail("no mode was tempting")
