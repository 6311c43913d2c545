import numpy as np
import pytest

from rigid_motion.motion import shell_error
from rigid_motion_batch.analysis.choices import Radii, Uniform
from rigid_motion_batch.analysis.results import clip_result
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import compare_clip


@pytest.mark.parametrize("body", [False, True])
def test_errors_are_those_between_what_is_shown(body: bool) -> None:
    clip = swinging_body() if body else read_source(str(ASSETS / "reach.csv"), "unity")[0][0]
    result = compare_clip(clip, Uniform("7"), ("lerp_slerp", "motor_spline"), Radii())
    truth = clip_result(clip, [result]).truth
    for motion in result.motions:
        there = truth[..., result.first : result.first + motion.errors.shape[1]]
        apart = np.linalg.norm(motion.poses.positions - there.positions, axis=-1)
        np.testing.assert_allclose(motion.errors[1], np.atleast_2d(apart).max(axis=0), atol=1e-6)
        assert motion.errors[0].max() == pytest.approx(motion.metrics[0].max_shell_m)
        if not body:
            np.testing.assert_allclose(motion.errors[0], shell_error(motion.poses, there, 0.1), atol=1e-12)
