"""What a comparison finds of a clip agrees with the recording and with what was measured of it."""

import numpy as np
import pytest

from rigid_motion.motion import shell_error
from rigid_motion_batch.analysis.choices import Radii, Tolerance, Uniform
from rigid_motion_batch.analysis.results import clip_result
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import compare_clip

MODES = ("lerp_slerp", "dq_sclerp", "pga_slerp", "motor_spline")


@pytest.mark.parametrize("choice", [Uniform("7"), Tolerance("5mm")])
def test_errors_of_a_rigid_body_are_those_between_what_is_shown(choice) -> None:
    (clip,), _ = read_source(str(ASSETS / "reach.csv"), "unity")
    result = compare_clip(clip, choice, MODES, Radii())
    whole = clip_result(clip, [result])
    assert sorted(row.mode for row in result.rows) == sorted(MODES)
    for motion in result.motions:
        samples = slice(result.first, result.first + motion.errors.shape[1])
        truth = whole.truth[samples]
        assert np.allclose(motion.errors[0], shell_error(motion.poses, truth, 0.1), atol=1e-12)
        assert np.allclose(motion.errors[1], np.linalg.norm(motion.poses.positions - truth.positions, axis=1))
        assert all(motion.errors[0].max() == pytest.approx(row.max_shell_m, rel=1e-5) for row in motion.metrics)
        assert np.allclose(motion.errors[0, motion.keys - result.first], 0.0, atol=1e-12)
    assert ("dq_sclerp", "pga_slerp") in [motion.modes for motion in result.motions]


def test_of_a_body_the_joint_that_is_farthest_off_counts() -> None:
    clip = swinging_body()
    result = compare_clip(clip, Uniform("4"), MODES, Radii())
    whole = clip_result(clip, [result])
    for motion in result.motions:
        samples = slice(result.first, result.first + motion.errors.shape[1])
        apart = np.linalg.norm(motion.poses.positions - whole.truth.positions[:, samples], axis=-1)
        assert np.allclose(motion.errors[1], apart.max(axis=0), atol=1e-6)
        assert np.array_equal(motion.errors[0], motion.joint_errors.max(axis=0))
        assert motion.errors[0].max() == motion.metrics[0].max_shell_m
    assert len(result.joints) == len(MODES) * len(whole.facts.joint_names)
