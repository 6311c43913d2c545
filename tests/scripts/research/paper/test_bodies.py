"""Tests of the paper's study on bodies: its results match independent computations."""

import numpy as np
import pytest

from research.paper import bodies
from rigid_motion.motion import Poses
from tests.motion.bodies import body_errors
from tests.scripts.clips.bodies import PARENTS, swinging_body

NAMES = ("Hips", "Spine", "Head", "LeftArm", "LeftHand", "Glove", "RightLeg", "RightFoot")

BODY_CLIP = swinging_body("walk", seconds=2.0, rate=30.0, seed=3, joints=NAMES)

RADII = np.full(len(NAMES), 0.03)

METRES = Poses(BODY_CLIP.poses.positions * 0.01, BODY_CLIP.poses.quaternions)


def test_errors_of_the_body_are_those_of_matrices() -> None:
    rows = bodies.errors_of(BODY_CLIP)
    for mode in bodies.MODES:
        for rate in bodies.ERROR_RATES:
            keys = np.arange(0, 61, 30 // rate)
            errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
            assert rows[mode][rate][0] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)
