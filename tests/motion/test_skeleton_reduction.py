"""Tests of key reduction for whole bodies, with errors recomputed by matrices down the chains and singular values.

Separate keys of rotations and locations are played by SciPy's Slerp and np.interp.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from rigid_motion.motion import MODES, Poses, SeparateKeys, reduce_skeleton_keys
from tests.motion.bodies import body_errors, in_root_space, largest_displacements, wandering_body
from tests.thoroughness import tried

TWO_WAYS = pytest.mark.parametrize("shared", [False, True])


def check_keys(keys: list[np.ndarray], count: int, shared: bool, stretch: int | None = None) -> None:
    for own in keys:
        assert np.all(np.diff(own) > 0)
        assert np.all(np.diff(own) <= (stretch or count))
        assert (own[0], own[-1]) == (0, count - 1) or (len(own) == 1 and not shared and 0 <= own[0] < count)
    assert not shared or all(np.array_equal(own, keys[0]) for own in keys)


def rounding(poses: Poses, parents: np.ndarray) -> float:
    return 1e-13 * max(1.0, float(np.abs(in_root_space(poses, parents)).max()))


def channel_errors(
    times: np.ndarray, poses: Poses, parents: np.ndarray, keys: tuple[SeparateKeys, ...], radii: np.ndarray
) -> np.ndarray:
    """Return the errors of a body between keys of its channels, with each joint's first scale, shape (joints, n)."""
    positions, quaternions = np.empty_like(poses.positions), np.empty_like(poses.quaternions)
    for joint, (rotation, location) in enumerate(keys):
        for axis in range(3):
            values = poses.positions[joint, location, axis]
            positions[joint, :, axis] = np.interp(times, times[location], values)
        turns = Rotation.from_quat(poses.quaternions[joint, rotation], scalar_first=True)
        if len(rotation) > 1:
            turns = Slerp(times[rotation], turns)(times)
        quaternions[joint] = turns.as_quat(scalar_first=True)
    scales = None if poses.scales is None else np.broadcast_to(poses.scales[:, :1], poses.shape)
    shown = Poses(positions, quaternions, scales)
    return largest_displacements(in_root_space(shown, parents), in_root_space(poses, parents), radii)


def separable_body(count: int, joints: int, seed: int, **more: object) -> tuple[np.ndarray, Poses, np.ndarray]:
    """Return a body with a third of the rotations and a third of the locations constant, and all scales."""
    times, poses, parents = wandering_body(count, joints, seed, **more)
    random = np.random.default_rng(seed)
    for rows in (poses.positions, poses.quaternions):
        still = random.random(joints) < 1.0 / 3.0
        rows[still] = rows[still, :1]
    scales = None if poses.scales is None else poses.scales[:, :1].repeat(count, axis=1)
    return times, Poses(poses.positions, poses.quaternions, scales), parents


@settings(max_examples=tried(180))
@given(
    st.integers(1, 150),
    st.integers(1, 12),
    st.integers(0, 2**16),
    st.booleans(),
    st.sampled_from((1e-5, 1e-3, 0.02, 0.3)),
    st.sampled_from((None, "shared", "separate")),
    st.none() | st.integers(2, 60),
    st.sampled_from(tuple(MODES)),
)
def test_every_joint_stays_within_the_tolerance_everywhere(count, joints, seed, scaled, tolerance, how, stretch, mode):
    random, noise = np.random.default_rng(seed), (0.0, 1e-3)[seed % 2]
    mode = "lerp_slerp" if how == "separate" else mode
    stretch = None if how == "shared" or MODES[mode].is_smooth else stretch
    made = separable_body if how == "separate" else wandering_body
    times, poses, parents = made(count, joints, seed, scaled=scaled, noise=noise)
    radii, weights = random.choice((0.0, 0.03, 0.5), joints), random.choice((0.0, 0.5, 1.0, 2.0), (joints, count))
    weights[:, : count // 2] = weights[:, :1]
    weights[random.integers(joints), random.integers(count)] = 1.0
    fixed = random.random(joints) < 0.2
    options = {"tolerance": tolerance, "radius": radii, "weights": weights, "stretch": stretch, "fixed": fixed}
    keys = reduce_skeleton_keys(times, poses, parents, mode, **options, **({how: True} if how else {}))
    if how == "separate":
        errors = channel_errors(times, poses, parents, keys, radii)
        whole = reduce_skeleton_keys(times, poses, parents, mode, **options)
        numbers = sum(4 * len(own.rotation) + 3 * len(own.location) for own in keys)
        assert stretch or numbers <= 7 * sum(map(len, whole))
        for own, stays, *parts in zip(keys, fixed, poses.quaternions, poses.positions, strict=True):
            for samples, rows in zip(own, parts, strict=True):
                changes = np.ptp(rows, axis=0).any()
                assert stretch or changes or samples.tolist() == [0]
                assert stretch or len(samples) == count or not (changes and stays)
        keys = [own for channels in keys for own in channels]
    else:
        errors = body_errors(times, poses, parents, keys, mode, radii)
        assert all(len(keys[joint]) == count for joint in np.flatnonzero(fixed))
        keys = [keys[joint] for joint in np.flatnonzero(~fixed)]
    check_keys(keys, count, how == "shared", stretch)
    assert (weights * errors).max() <= tolerance * (1.0 + 1e-9) + (2.0 if stretch else 1.0) * rounding(poses, parents)


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
    check_keys(own, count, False)
    assert sum(map(len, own)) <= 2 * joints + more
    shared = reduce_skeleton_keys(*body, mode, budget=2 + more, shared=True)
    check_keys(shared, count, True)
    rests = all(not np.ptp(rows, axis=1).any() for rows in (body[1].positions, body[1].quaternions))
    assert len(shared[0]) == (2 if rests else min(2 + more, count))


@settings(max_examples=tried(20))
@given(st.integers(2, 90), st.integers(1, 6), st.integers(0, 2**16), st.integers(0, 120))
def test_a_budget_is_of_rotations_and_locations(count, joints, seed, more):
    times, poses, parents = separable_body(count, joints, seed)
    changing = sum(np.count_nonzero(np.ptp(rows, axis=1).any(axis=1)) for rows in (poses.positions, poses.quaternions))
    least = 2 * joints + changing
    keys = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", budget=least + more, separate=True)
    assert sum(len(own.rotation) + len(own.location) for own in keys) <= least + more
    if least > 2:
        with pytest.raises(ValueError, match=f"a budget of {least - 1} keys is too small for {changing} rotations and"):
            reduce_skeleton_keys(times, poses, parents, "lerp_slerp", budget=least - 1, separate=True)


@pytest.mark.parametrize(("separate", "stretch"), [(False, 50), (True, 50), (True, None)])
def test_what_jitters_below_the_tolerance_rests_from_beginning_to_end(separate, stretch):
    times, poses, parents = wandering_body(200, 5, 3, resting=0.0)
    jitter = poses.positions[:, :1] + np.random.default_rng(5).uniform(-1e-5, 1e-5, poses.positions.shape)
    poses.quaternions[:2] = poses.quaternions[:2, :1]
    poses = Poses(jitter, poses.quaternions)
    keys = reduce_skeleton_keys(
        times, poses, parents, "lerp_slerp", tolerance=0.002, separate=separate, stretch=stretch
    )
    if separate:
        assert [len(own.location) for own in keys] == [1] * 5
        keys = [own.rotation for own in keys]
    assert [len(own) == 1 for own in keys] == [True, True, False, False, False]


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
