"""Errors of bodies between samples, recomputed by SciPy's slerp, NumPy's interp and matrices down the chains."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES, Poses, SeparateKeys, interpolate, reduce_skeleton_keys, skeleton_errors
from rigid_motion.motion.quaternions import align_signs
from tests.motion.bodies import body_errors, in_root_space, largest_displacements, wandering_body
from tests.motion.test_skeleton_channels import channels_shown
from tests.thoroughness import tried


def random_keys(random: np.random.Generator, count: int) -> np.ndarray:
    if random.random() < 0.2:
        return random.integers(count, size=1)
    return np.union1d((0, count - 1), np.flatnonzero(random.random(count) < random.random()))


def with_gaps(errors: np.ndarray, parts: int) -> np.ndarray:
    """Errors (joints, (n - 1) * parts + 1) as the largest from each sample to the next, (joints, n)."""
    inner = errors[:, :-1].reshape(len(errors), -1, parts).max(axis=2)
    return np.concatenate((inner, errors[:, -1:]), axis=1)


@settings(max_examples=tried(40))
@given(st.integers(2, 60), st.integers(1, 8), st.integers(0, 2**16), st.booleans(), st.integers(1, 8))
def test_errors_of_channels_between_samples(count, joints, seed, scaled, parts):
    random = np.random.default_rng(seed)
    times, poses, parents = wandering_body(count, joints, seed, scaled=scaled)
    if scaled:
        poses = Poses(poses.positions, poses.quaternions, poses.scales[:, :1].repeat(count, axis=1))
    keys = tuple(SeparateKeys(random_keys(random, count), random_keys(random, count)) for _ in range(joints))
    moments = np.append(times[:-1, None] + np.diff(times)[:, None] * np.arange(parts) / parts, times[-1])
    every = (SeparateKeys(np.arange(count), np.arange(count)),) * joints
    shown, truth = (in_root_space(channels_shown(times, poses, some, moments), parents) for some in (keys, every))
    radii = random.choice((0.0, 0.03, 0.5), joints)
    errors = with_gaps(largest_displacements(shown, truth, radii), parts)
    result = skeleton_errors(times, poses, parents, keys, radius=radii, parts=parts)
    np.testing.assert_allclose(result, errors, rtol=1e-6, atol=1e-9 * max(1.0, np.abs(truth).max()))


@settings(max_examples=tried(20))
@given(st.integers(2, 60), st.integers(1, 6), st.integers(0, 2**16), st.sampled_from(tuple(MODES)))
def test_errors_of_joints_in_every_mode(count, joints, seed, mode):
    random = np.random.default_rng(seed)
    times, poses, parents = wandering_body(count, joints, seed)
    poses = Poses(poses.positions, align_signs(poses.quaternions))
    keys = [random_keys(random, count) for _ in range(joints)]
    radii = np.full(joints, 0.03)
    np.testing.assert_allclose(
        skeleton_errors(times, poses, parents, keys, mode, parts=1),
        body_errors(times, poses, parents, keys, mode, radii),
        rtol=1e-6,
        atol=1e-9,
    )
    middles = np.append(times[:-1, None] + np.diff(times)[:, None] * np.arange(2) / 2, times[-1])
    finer = interpolate(times, poses, middles, mode)
    shown = [interpolate(times[own], poses[joint][own], middles, mode) for joint, own in enumerate(keys)]
    shown = Poses([joint.positions for joint in shown], [joint.quaternions for joint in shown])
    errors = largest_displacements(in_root_space(shown, parents), in_root_space(finer, parents), radii)
    result = skeleton_errors(times, poses, parents, keys, mode, parts=2)
    np.testing.assert_allclose(result, with_gaps(errors, 2), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline", "motor_spline_causal"])
def test_long_recordings_are_measured_piece_by_piece(mode, monkeypatch):
    times, poses, parents = wandering_body(300, 5, 1)
    keys = reduce_skeleton_keys(times, poses, parents, mode, tolerance=0.02)
    whole = skeleton_errors(times, poses, parents, keys, mode)
    for at_once in (1, 400, 2000):
        monkeypatch.setattr("rigid_motion.motion.skeleton_measures.AT_ONCE", at_once)
        np.testing.assert_allclose(skeleton_errors(times, poses, parents, keys, mode), whole, rtol=1e-6, atol=1e-9)


def test_what_is_stored_at_keys_may_differ_from_what_was_recorded():
    times, poses, parents = wandering_body(40, 3, 2)
    keys = [np.arange(40)] * 3
    rounded = Poses(poses.positions, np.round(poses.quaternions, 3))
    assert skeleton_errors(times, poses, parents, keys).max() < 1e-12
    errors = skeleton_errors(times, poses, parents, keys, stored=rounded, parts=1)
    lengths = np.linalg.norm(rounded.quaternions, axis=-1, keepdims=True)
    there = in_root_space(Poses(poses.positions, rounded.quaternions / lengths), parents)
    np.testing.assert_allclose(
        errors, largest_displacements(there, in_root_space(poses, parents), np.full(3, 0.03)), atol=1e-9
    )
    assert errors.max() > 1e-5
