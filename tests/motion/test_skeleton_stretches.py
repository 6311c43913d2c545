"""Tests of reducing long recordings of bodies in stretches, with independently computed errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES, Poses, reduce_skeleton_keys
from tests.motion.bodies import body_errors, in_root_space, wandering_body
from tests.motion.test_skeleton_channels import channel_errors
from tests.thoroughness import tried

STRAIGHT = tuple(name for name, mode in MODES.items() if not mode.is_smooth)
TWO_WAYS = pytest.mark.parametrize("separate", [False, True])


@settings(max_examples=tried(60))
@given(
    st.integers(3, 150),
    st.integers(1, 10),
    st.integers(0, 2**16),
    st.booleans(),
    st.sampled_from((1e-5, 1e-3, 0.02, 0.3)),
    st.integers(2, 60),
    st.sampled_from((None, *STRAIGHT)),
)
def test_every_joint_stays_within_the_tolerance_everywhere(count, joints, seed, scaled, tolerance, stretch, mode):
    """Without a mode, rotations and locations have separate keys."""
    random = np.random.default_rng(seed)
    times, poses, parents = wandering_body(count, joints, seed, scaled=scaled, noise=(0.0, 1e-3)[seed % 2])
    if mode is None and scaled:
        poses = Poses(poses.positions, poses.quaternions, poses.scales[:, :1].repeat(count, axis=1))
    radii, weights = random.choice((0.0, 0.03, 0.5), joints), random.choice((0.0, 0.5, 1.0, 2.0), (joints, count))
    weights[:, : count // 2] = weights[:, :1]
    weights[random.integers(joints), random.integers(count)] = 1.0
    fixed = random.random(joints) < 0.2
    options = {"tolerance": tolerance, "radius": radii, "weights": weights, "stretch": stretch, "fixed": fixed}
    if mode is None:
        result = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", separate=True, **options)
        errors = channel_errors(times, poses, parents, result, radii)
        keys = [own for channels in result for own in channels]
    else:
        keys = reduce_skeleton_keys(times, poses, parents, mode, **options)
        errors = body_errors(times, poses, parents, keys, mode, radii)
        assert [len(own) == count for own, stays in zip(keys, fixed, strict=True) if stays] == [True] * sum(fixed)
    rounding = 1e-13 * max(1.0, float(np.abs(in_root_space(poses, parents)).max()))
    assert (weights * errors).max() <= tolerance * (1.0 + 1e-9) + 2.0 * rounding
    for own in keys:
        assert len(own) == 1 or (own[0], own[-1]) == (0, count - 1)
        assert len(own) == 1 or (np.diff(own).min() > 0 and np.diff(own).max() <= stretch)


@TWO_WAYS
def test_what_jitters_below_the_tolerance_rests_from_beginning_to_end(separate):
    times, poses, parents = wandering_body(200, 5, 3, resting=0.0)
    jitter = poses.positions[:, :1] + np.random.default_rng(5).uniform(-1e-5, 1e-5, poses.positions.shape)
    poses.quaternions[:2] = poses.quaternions[:2, :1]
    poses = Poses(jitter, poses.quaternions)
    keys = reduce_skeleton_keys(times, poses, parents, "lerp_slerp", tolerance=0.002, separate=separate, stretch=50)
    if separate:
        assert [len(own.location) for own in keys] == [1] * 5
        keys = [own.rotation for own in keys]
    assert [len(own) == 1 for own in keys] == [True, True, False, False, False]
