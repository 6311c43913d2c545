"""Property tests of what every mode guarantees for any keys."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rigid_motion.motion import KEYFRAME_MODES, MODES, Poses, in_betweens, interpolate
from rigid_motion.motion.quaternions import angle_between, normalise
from tests.thoroughness import tried

every_mode = pytest.mark.parametrize("mode", MODES)
numbers = st.floats(-100.0, 100.0, width=32)


@st.composite
def motions(draw, least=2, most=6, scaled=False):
    """Key times and keys: unevenly spaced, with repeated poses and half turns among them."""
    count = draw(st.integers(least, most))
    intervals = draw(arrays(float, count, elements=st.floats(0.015625, 8.0, width=32)))
    quaternions = draw(arrays(float, (count, 4), elements=st.floats(-1.0, 1.0, width=32)))
    assume(np.all(np.linalg.norm(quaternions, axis=1) > 1e-3))
    positions = draw(arrays(float, (count, 3), elements=numbers))
    scales = draw(arrays(float, count, elements=st.floats(0.0625, 16.0, width=32))) if scaled else None
    if draw(st.booleans()):
        positions[-1], quaternions[-1] = positions[0], quaternions[0]
    return np.cumsum(intervals), Poses(positions, normalise(quaternions), scales)


def assert_close(a: Poses, b: Poses, tolerance: float = 1e-9) -> None:
    assert np.abs(a.positions - b.positions).max() <= tolerance * (1.0 + np.abs(b.positions).max())
    assert angle_between(a.quaternions, b.quaternions).max() <= tolerance


def no_half_turn(keys: Poses) -> bool:
    """Return whether no neighbouring keys are so near 180 degrees apart that rounding decides the direction."""
    dots = np.sum(keys.quaternions[1:] * keys.quaternions[:-1], axis=1)
    return bool(np.all(np.abs(dots) > 1e-6))


def times_between(key_times: np.ndarray, count: int = 37) -> np.ndarray:
    return np.linspace(key_times[0], key_times[-1], count)


@given(motion=motions(least=1) | motions(scaled=True))
def test_keys_are_met_and_end_poses_hold_outside_of_them(motion):
    key_times, keys = motion
    outside = [key_times[0] - 5.0, *key_times, key_times[-1] + 5.0]
    expected = keys[[0, *range(len(keys)), -1]]
    for mode in MODES:
        poses = interpolate(key_times, keys, outside, mode)
        assert_close(poses, expected, 1e-12)
        assert keys.scales is None or poses.scales == pytest.approx(expected.scales, rel=1e-12), mode


@given(motion=motions(), seed=st.integers(0, 2**32 - 1))
def test_q_and_minus_q_give_the_same_path(motion, seed):
    key_times, keys = motion
    assume(no_half_turn(keys))
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), size=(len(keys), 1))
    times, flipped = times_between(key_times), Poses(keys.positions, signs * keys.quaternions)
    for mode in MODES:
        assert_close(interpolate(key_times, flipped, times, mode), interpolate(key_times, keys, times, mode), 1e-12)


@given(motion=motions(scaled=True), shift=arrays(float, 3, elements=numbers))
def test_the_origin_of_the_world_does_not_matter_even_where_things_grow(motion, shift):
    key_times, keys = motion
    assume(no_half_turn(keys))
    times, moved = times_between(key_times), Poses(keys.positions + shift, keys.quaternions, keys.scales)
    for mode in MODES:
        there, here = (interpolate(key_times, own, times, mode) for own in (moved, keys))
        assert_close(there, Poses(here.positions + shift, here.quaternions), 1e-7)


@settings(max_examples=tried(60))
@given(
    motions(scaled=True),
    st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=6),
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=6),
)
def test_outside_of_the_keys_scales_stay_positive_and_all_is_finite(motion, logarithms, progress):
    key_times, keys = motion
    count = len(key_times)
    both = (keys.scales, np.exp(2.0 * np.resize(logarithms, count)))
    for mode, scales in itertools.product(MODES, both):
        growing = Poses(keys.positions, keys.quaternions, scales)
        times = key_times[0] + np.array(progress) * (key_times[-1] - key_times[0])
        beyond = interpolate(key_times, growing, times, mode, extrapolate=True)
        eased = in_betweens(key_times, growing, [len(progress)] * (count - 1), np.tile(progress, count - 1), mode)
        for poses in (beyond, eased):
            assert np.all(poses.scales > 0.0)
            assert all(np.isfinite(rows).all() for rows in (poses.positions, poses.quaternions, poses.scales))


def test_a_versor_blend_with_growth_stops_half_way_to_where_it_has_no_scale():
    keys = Poses([[0, 0, 0], [1, 0, 0]], [[1, 0, 0, 0]] * 2, [1.0, 10.0])
    root = np.sqrt(10.0)
    pole = 0.5 + 0.5 * (root + 1.0) / (root - 1.0)
    u = np.array([0.0, 0.5, 0.99, 1.0, 1.01, 2.0, 1e6]) * (pole - 1.0) + 1.0
    shown = interpolate([0, 1], keys, u, "cga_lerp", extrapolate=True)
    assert np.all(np.diff(shown.scales[:2]) > 0.0)
    assert shown.scales[1:] == pytest.approx(shown.scales[1])
    blend = ((1.0 - u[1]) + u[1] * root) / ((1.0 - u[1]) + u[1] / root)
    assert shown.scales[1] == pytest.approx(blend)
    # Without growth it never stops.
    still = interpolate(
        [0, 1], Poses(keys.positions, keys.quaternions, [3.0, 3.0]), [50.0], "cga_lerp", extrapolate=True
    )
    assert still.positions[0, 0] == pytest.approx(50.0)


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_extrapolation_goes_on_with_the_last_segment(mode):
    keys = Poses([[0, 0, 0], [5, 0, 0], [1, 2, 0]], [[1, 0, 0, 0], [1, 0, 0, 0], [np.cos(0.3), 0, 0, np.sin(0.3)]])
    beyond = interpolate([0, 1, 2], keys, [2.5, -0.5], mode, extrapolate=True)
    alone = MODES[mode].reference(keys[[1]], keys[[2]], np.array([1.5]))
    assert_close(beyond[[0]], alone, 1e-12)
    assert_close(beyond[[1]], Poses([[-2.5, 0, 0]], [[1, 0, 0, 0]]), 1e-12)


@every_mode
@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
@pytest.mark.parametrize("own_key_times", [False, True])
@pytest.mark.parametrize("own_times", [False, True])
def test_many_objects_at_once_are_the_objects_one_by_one(mode, scaled, own_key_times, own_times):
    random = np.random.default_rng(5)
    shape = (2, 7, 11)
    quaternions = random.normal(size=(*shape, 4))
    keys = Poses(random.normal(size=(*shape, 3)), quaternions, np.exp(random.normal(size=shape)) if scaled else None)
    key_times = np.cumsum(random.uniform(0.1, 1.0, size=shape if own_key_times else shape[-1:]), axis=-1)
    times = random.uniform(-1.0, 8.0, size=(2, 7, 400) if own_times else (400,))
    together = interpolate(key_times, keys, times, mode)
    assert together.shape == (2, 7, 400)
    for row in np.ndindex(2, 7):
        alone = interpolate(
            key_times[row] if own_key_times else key_times, keys[row], times[row] if own_times else times, mode
        )
        assert np.array_equal(together.positions[row], alone.positions)
        assert np.array_equal(together.quaternions[row], alone.quaternions)
        if scaled:
            assert np.array_equal(together.scales[row], alone.scales)


@every_mode
def test_no_times_give_no_poses(mode):
    assert len(interpolate([0, 1], Poses(np.zeros((2, 3)), np.eye(4)[:2]), [], mode)) == 0


@given(motion=motions())
@settings(max_examples=tried(30))
def test_the_caller_s_arrays_stay_as_they_are(motion):
    key_times, keys = motion
    before = key_times.copy(), keys.positions.copy(), keys.quaternions.copy()
    for mode in MODES:
        interpolate(key_times, keys, times_between(key_times), mode)
    assert all(
        np.array_equal(*pair) for pair in zip(before, (key_times, keys.positions, keys.quaternions), strict=True)
    )


@pytest.mark.parametrize("name", [name for name, mode in MODES.items() if mode.same])
@given(motion=motions())
def test_a_mode_that_is_said_to_be_the_same_motion_as_another_is_that(motion, name):
    key_times, keys = motion
    other = MODES[name].twin or "dq_sclerp"
    assert f"same motion as {MODES[other].label}" in MODES[name].same
    if MODES[name].is_smooth:
        key_times, keys = key_times[:2], keys[:2]
    times = times_between(key_times)
    assert_close(interpolate(key_times, keys, times, name), interpolate(key_times, keys, times, other))
