"""Tests of separate keys for rotations and locations, recomputed by SciPy's Slerp, np.interp and matrices."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from rigid_motion.motion import Poses, SeparateKeys, reduce_skeleton_keys
from tests.motion.bodies import in_root_space, largest_displacements, wandering_body
from tests.thoroughness import tried


def channels_shown(
    times: np.ndarray, poses: Poses, keys: tuple[SeparateKeys, ...], moments: np.ndarray | None = None
) -> Poses:
    """Return poses (joints, m) between keys of the channels at these moments (m,), with each joint's first scale."""
    moments = times if moments is None else moments
    positions, quaternions = np.empty((len(keys), len(moments), 3)), np.empty((len(keys), len(moments), 4))
    for joint, (rotation, location) in enumerate(keys):
        for axis in range(3):
            values = poses.positions[joint, location, axis]
            positions[joint, :, axis] = np.interp(moments, times[location], values)
        turns = Rotation.from_quat(poses.quaternions[joint, rotation], scalar_first=True)
        if len(rotation) > 1:
            turns = Slerp(times[rotation], turns)(moments)
        quaternions[joint] = turns.as_quat(scalar_first=True)
    scales = None if poses.scales is None else np.broadcast_to(poses.scales[:, :1], positions.shape[:2])
    return Poses(positions, quaternions, scales)


def channel_errors(
    times: np.ndarray, poses: Poses, parents: np.ndarray, keys: tuple[SeparateKeys, ...], radii: np.ndarray
) -> np.ndarray:
    """Return the errors of a body between keys of its channels, shape (joints, n)."""
    shown = channels_shown(times, poses, keys)
    return largest_displacements(in_root_space(shown, parents), in_root_space(poses, parents), radii)


def numbers_in(keys: tuple[SeparateKeys, ...]) -> int:
    return sum(4 * len(own.rotation) + 3 * len(own.location) for own in keys)


def with_constant_channels(poses: Poses, seed: int) -> Poses:
    """Return the poses with a third of the rotations and a third of the locations constant."""
    random = np.random.default_rng(seed)
    positions, quaternions = poses.positions.copy(), poses.quaternions.copy()
    for rows in (positions, quaternions):
        still = random.random(len(rows)) < 1.0 / 3.0
        rows[still] = rows[still, :1]
    return Poses(positions, quaternions, poses.scales)


@settings(max_examples=tried(60))
@given(
    st.integers(1, 120),
    st.integers(1, 12),
    st.integers(0, 2**16),
    st.booleans(),
    st.sampled_from((1e-5, 1e-3, 0.02, 0.3)),
)
def test_every_joint_stays_within_the_tolerance_with_no_more_numbers(count, joints, seed, scaled, tolerance):
    random = np.random.default_rng(seed)
    times, poses, parents = wandering_body(count, joints, seed, scaled=scaled, noise=(0.0, 1e-3)[seed % 2])
    scales = None if poses.scales is None else poses.scales[:, :1].repeat(count, axis=1)
    poses = with_constant_channels(Poses(poses.positions, poses.quaternions, scales), seed)
    radii, weights = random.choice((0.0, 0.03, 0.5), joints), random.choice((0.0, 0.5, 1.0, 2.0), joints)
    weights[random.integers(joints)] = 1.0
    options = {"tolerance": tolerance, "radius": radii, "weights": weights}
    keys = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", separate=True, **options)
    whole = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", **options)
    assert numbers_in(keys) <= 7 * sum(map(len, whole))
    for joint, own in enumerate(keys):
        for samples, rows in zip(own, (poses.quaternions[joint], poses.positions[joint]), strict=True):
            assert np.all(np.diff(samples) > 0)
            assert (samples[0], samples[-1]) == (0, count - 1) or len(samples) == 1
            assert samples.tolist() == [0] or not np.array_equal(rows, np.broadcast_to(rows[:1], rows.shape))
    errors = weights[:, None] * channel_errors(times, poses, parents, keys, radii)
    rounding = 1e-13 * max(1.0, float(np.abs(in_root_space(poses, parents)).max()))
    assert errors.max() <= tolerance * (1.0 + 1e-9) + rounding


def test_a_channel_that_jitters_below_the_tolerance_rests_at_one_sample():
    times, poses, parents = wandering_body(90, 4, 5, resting=0.0)
    jitter = poses.positions[:, :1] + np.random.default_rng(5).uniform(-1e-5, 1e-5, poses.positions.shape)
    keys = reduce_skeleton_keys(
        times, Poses(jitter, poses.quaternions), parents, "lerp_slerp", tolerance=0.001, separate=True
    )
    assert [len(own.location) for own in keys] == [1] * 4
    assert sum(len(own.rotation) for own in keys) > 20


def test_fixed_joints_keep_all_that_changes_and_weights_count():
    times, poses, parents = wandering_body(80, 6, 2, resting=0.0)
    fixed, weights = np.array((False, True, False, True, False, False)), np.array((1.0, 1.0, 5.0, 1.0, 1.0, 1.0))
    poses.positions[3] = poses.positions[3, 0]
    keys = reduce_skeleton_keys(
        *(times, poses, parents, "lerp_slerp"), tolerance=0.02, separate=True, fixed=fixed, weights=weights
    )
    assert [len(own.rotation) == 80 for own in keys] == fixed.tolist()
    assert [len(keys[1].location), len(keys[3].location)] == [80, 1]
    errors = channel_errors(times, poses, parents, keys, np.full(6, 0.03)).max(axis=1)
    assert (errors * weights).max() <= 0.02 * (1.0 + 1e-9)


@settings(max_examples=tried(20))
@given(st.integers(2, 90), st.integers(1, 6), st.integers(0, 2**16), st.integers(0, 120))
def test_a_budget_is_of_rotations_and_locations(count, joints, seed, more):
    times, poses, parents = wandering_body(count, joints, seed)
    poses = with_constant_channels(poses, seed)
    changing = sum(np.count_nonzero(np.ptp(rows, axis=1).any(axis=1)) for rows in (poses.positions, poses.quaternions))
    least = 2 * joints + changing
    keys = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", budget=least + more, separate=True)
    assert sum(len(own.rotation) + len(own.location) for own in keys) <= least + more
    if least > 2:
        with pytest.raises(ValueError, match=f"a budget of {least - 1} keys is too small for {changing} rotations and"):
            reduce_skeleton_keys(times, poses, parents, "lerp_slerp", budget=least - 1, separate=True)
