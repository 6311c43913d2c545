"""Tests of key reduction for whole bodies, with errors recomputed by matrices down the chains and singular values."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES, Poses, reduce_skeleton_keys
from tests.motion.bodies import body_errors, in_root_space, wandering_body
from tests.thoroughness import tried

TWO_WAYS = pytest.mark.parametrize("shared", [False, True])


def check_keys(keys: tuple[np.ndarray, ...], joints: int, count: int, shared: bool) -> None:
    assert len(keys) == joints
    for own in keys:
        assert np.all(np.diff(own) > 0)
        assert (own[0], own[-1]) == (0, count - 1) or (len(own) == 1 and not shared and 0 <= own[0] < count)
    assert not shared or all(np.array_equal(own, keys[0]) for own in keys)


def rounding(poses: Poses, parents: np.ndarray) -> float:
    return 1e-13 * max(1.0, float(np.abs(in_root_space(poses, parents)).max()))


@settings(max_examples=tried(60))
@given(
    st.integers(1, 120),
    st.integers(1, 12),
    st.integers(0, 2**16),
    st.booleans(),
    st.booleans(),
    st.sampled_from((1e-5, 1e-3, 0.02, 0.3)),
    st.sampled_from(tuple(MODES)),
)
def test_every_joint_stays_within_the_tolerance_everywhere(count, joints, seed, scaled, shared, tolerance, mode):
    random = np.random.default_rng(seed)
    times, poses, parents = wandering_body(count, joints, seed, scaled=scaled, noise=(0.0, 1e-3)[seed % 2])
    radii, weights = random.choice((0.0, 0.03, 0.5), joints), random.choice((0.0, 0.5, 1.0, 2.0), joints)
    weights[random.integers(joints)] = 1.0
    options = {"tolerance": tolerance, "radius": radii, "weights": weights, "shared": shared}
    keys = reduce_skeleton_keys(times, poses, parents, mode, **options)
    check_keys(keys, joints, count, shared)
    errors = weights[:, None] * body_errors(times, poses, parents, keys, mode, radii)
    assert errors.max() <= tolerance * (1.0 + 1e-9) + rounding(poses, parents)


@settings(max_examples=tried(20))
@given(st.integers(4, 10), st.integers(0, 2**16), st.sampled_from((0.003, 0.03, 0.3)), st.sampled_from(tuple(MODES)))
def test_keys_of_their_own_are_no_more_than_key_poses(joints, seed, tolerance, mode):
    """Of 260 bodies, four had up to four more own keys, in one or two joints: key poses are searched for longer."""
    times, poses, parents = wandering_body(60, joints, seed)
    own, shared = (
        reduce_skeleton_keys(times, poses, parents, mode, tolerance=tolerance, shared=shared)
        for shared in (False, True)
    )
    assert sum(map(len, own)) <= sum(map(len, shared))


@TWO_WAYS
def test_weights_may_change_with_time(shared):
    times, poses, parents = wandering_body(80, 4, 1, resting=0.0)
    weights = np.ones((4, 80))
    weights[2, 20:50] = 5.0
    keys = reduce_skeleton_keys(times, poses, parents, tolerance=0.02, shared=shared, weights=weights)
    errors = body_errors(times, poses, parents, keys, "motor_spline", np.full(4, 0.03))
    assert (errors * weights).max() <= 0.02 * (1.0 + 1e-9)
    assert errors[2, 50:].max() > 0.004


@TWO_WAYS
def test_joints_that_are_fixed_keep_all_samples_and_what_hangs_on_them_is_within_the_tolerance(shared):
    times, poses, parents = wandering_body(80, 6, 2, resting=0.0)
    fixed = np.array((False, True, False, True, False, False))
    keys = reduce_skeleton_keys(times, poses, parents, tolerance=0.02, shared=shared, fixed=fixed)
    assert [len(own) == 80 for own in keys] == fixed.tolist()
    errors = body_errors(times, poses, parents, keys, "motor_spline", np.full(6, 0.03))
    assert errors.max() <= 0.02 * (1.0 + 1e-9)


def test_joints_of_weight_zero_have_no_keys_for_themselves():
    times, poses, _ = wandering_body(80, 4, 3, resting=0.0)
    keys = reduce_skeleton_keys(times, poses, [-1, 0, 1, 0], tolerance=1e-3, weights=[1.0, 0.0, 0.0, 1.0])
    assert [len(own) == 1 for own in keys] == [False, True, True, False]
    # The joint that matters is a descendant of joints that do not, so they must be right as well.
    keys = reduce_skeleton_keys(times, poses, [-1, 0, 1, 2], tolerance=1e-3, weights=[0.0, 0.0, 0.0, 1.0])
    assert all(len(own) > 2 for own in keys)


@settings(max_examples=tried(20))
@given(st.integers(2, 90), st.integers(1, 6), st.integers(0, 2**16), st.integers(0, 120), st.sampled_from(tuple(MODES)))
@example(count=3, joints=1, seed=56, more=1, mode="lerp_slerp")  # At rest, two keys are enough.
def test_a_budget_is_kept(count, joints, seed, more, mode):
    body = wandering_body(count, joints, seed)
    own = reduce_skeleton_keys(*body, mode, budget=2 * joints + more)
    check_keys(own, joints, count, False)
    assert sum(map(len, own)) <= 2 * joints + more
    shared = reduce_skeleton_keys(*body, mode, budget=2 + more, shared=True)
    check_keys(shared, joints, count, True)
    rests = all(not np.ptp(rows, axis=1).any() for rows in (body[1].positions, body[1].quaternions))
    assert len(shared[0]) == (2 if rests else min(2 + more, count))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("count", [1, 2, 3, 500])
def test_a_body_at_rest_has_one_key_each_or_two_key_poses(count, mode):
    times, moving, parents = wandering_body(2, 5, 1, scaled=True)
    poses = Poses(*(np.repeat(rows[:, :1], count, axis=1) for rows in (moving.positions, moving.quaternions)))
    times = np.arange(float(count))
    assert [len(own) for own in reduce_skeleton_keys(times, poses, parents, mode, tolerance=1e-9)] == [1] * 5
    assert [len(own) for own in reduce_skeleton_keys(times, poses, parents, mode, budget=10)] == [1] * 5
    shared = reduce_skeleton_keys(times, poses, parents, mode, tolerance=1e-9, shared=True)
    assert [own.tolist() for own in shared] == [sorted({0, count - 1})] * 5


@TWO_WAYS
@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline", "motor_spline_causal"])
@pytest.mark.parametrize("tolerance", [1e-39, 1e-17, 1e-15])
def test_a_tolerance_below_rounding_comes_to_an_end(tolerance, mode, scaled, shared):
    times, poses, parents = wandering_body(30, 4, 5, scaled=scaled, resting=0.0, noise=1e-3)
    keys = reduce_skeleton_keys(times, poses, parents, mode, tolerance=tolerance, shared=shared)
    assert [len(own) for own in keys] == [30] * 4


@TWO_WAYS
@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline"])
def test_bodies_that_are_small_large_and_far_away_keep_to_the_tolerance(mode, scale, shared):
    times, poses, parents = wandering_body(50, 5, 6, scaled=True)
    roots = (parents < 0)[:, None]
    scales = np.where(roots, scale, 1.0) * poses.scales
    positions = np.where(roots[..., None], scale * poses.positions + 1e6, poses.positions)
    poses, tolerance = Poses(positions, poses.quaternions, scales), 0.02 * scale
    keys = reduce_skeleton_keys(times, poses, parents, mode, tolerance=tolerance, shared=shared)
    errors = body_errors(times, poses, parents, keys, mode, np.full(5, 0.03))
    assert 0.1 * tolerance < errors.max() <= tolerance * (1.0 + 1e-9) + rounding(poses, parents)
    assert sum(map(len, keys)) < 200


TIMES, BODY, _ = wandering_body(20, 3, 1, resting=0.0)
CHAIN = [-1, 0, 1]


@TWO_WAYS
@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("positions", np.nan, "joint 2, sample 7 is not finite"),
        ("quaternions", np.inf, "joint 2, sample 7 is not finite"),
        ("quaternions", 0.0, "joint 2, sample 7 has a quaternion of length zero"),
        ("scales", -1.0, "joint 2, sample 7 has a scale that is not a positive number"),
    ],
)
def test_bad_samples_are_named_with_their_joint(part, value, message, shared):
    parts = {"positions": BODY.positions.copy(), "quaternions": BODY.quaternions.copy(), "scales": np.ones((3, 20))}
    parts[part][2, 7] = value
    with pytest.raises(ValueError, match=message):
        reduce_skeleton_keys(TIMES, Poses(**parts), CHAIN, tolerance=0.1, shared=shared)


@TWO_WAYS
def test_what_is_sound_by_itself_and_too_large_in_the_root_space_is_named(shared):
    poses = Poses(BODY.positions, BODY.quaternions, np.full((3, 20), 1e30))
    with pytest.raises(ValueError, match="joint 1, in the root's space, sample 0 "):
        reduce_skeleton_keys(TIMES, poses, CHAIN, tolerance=0.1, shared=shared)


def test_a_chain_of_any_length_has_key_poses_and_one_that_is_too_long_no_keys_of_its_own():
    joints = 1500
    positions = np.zeros((joints, 5, 3))
    positions[0, :, 0] = (0.0, 1.0, 0.0, 2.0, 0.0)
    poses, parents = Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (joints, 5, 1))), np.arange(joints) - 1
    assert reduce_skeleton_keys(np.arange(5.0), poses, parents, "lerp_slerp", tolerance=0.1, shared=True)[0].size == 5
    with pytest.raises(ValueError, match=r"joint 1499 hangs on 1499 others, .* 1000 at most: shared=True"):
        reduce_skeleton_keys(np.arange(5.0), poses, parents, tolerance=0.1)
    branches = np.append(-1, np.zeros(joints - 1, dtype=int))
    keys = reduce_skeleton_keys(np.arange(5.0), poses, branches, "lerp_slerp", tolerance=0.1)
    assert list(map(len, keys)) == [5] + [1] * (joints - 1)
