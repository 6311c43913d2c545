"""Tests of the error measures against matrices and SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses, measure, rms, shell_error
from rigid_motion.motion.quaternions import normalise
from tests.motion.bodies import largest_displacements, matrices
from tests.motion.cases import random_quaternions


def pairs(count: int, seed: int, growing: bool) -> tuple[Poses, Poses]:
    """Return pairs of poses that differ a little or a lot in position, rotation and scale."""
    random = np.random.default_rng(seed)
    near, nearer, nearest = 10.0 ** random.uniform((-6, -6, -8), (1, 1, 0), (count, 3)).T[..., None]
    truth = random.normal(size=(count, 3)), random_quaternions(random, count)
    quaternions = normalise(truth[1] + nearer * random.normal(size=(count, 4)))
    scales = np.exp(random.normal(size=count)) if growing else None
    grown = scales * np.exp(nearest[:, 0] * random.normal(size=count)) if growing else None
    return Poses(truth[0] + near * random.normal(size=(count, 3)), quaternions, grown), Poses(*truth, scales)


@pytest.mark.parametrize("growing", [False, True])
def test_errors_are_those_of_balls_origins_rotations_and_the_drift_between_samples(growing):
    times = np.cumsum(np.random.default_rng(3).uniform(0.01, 1.0, 300))
    poses, truth = pairs(300, 2, growing)
    errors = measure(times, poses, truth, radius=0.7)
    expected = largest_displacements(matrices(poses), matrices(truth), 0.7)
    np.testing.assert_allclose(errors.shell, expected, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(shell_error(poses, truth, radius=0.7), errors.shell)
    off = poses.positions - truth.positions
    np.testing.assert_allclose(errors.position, np.linalg.norm(off, axis=1), rtol=1e-12)
    rotations = (Rotation.from_quat(some.quaternions, scalar_first=True) for some in (poses, truth))
    np.testing.assert_allclose(errors.rotation, (next(rotations).inv() * next(rotations)).magnitude(), atol=1e-14)
    drift = np.linalg.norm(np.diff(off, axis=0), axis=1) / np.diff(times)
    np.testing.assert_allclose(errors.velocity, drift, rtol=1e-9)


def test_rms():
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([])) == 0.0
