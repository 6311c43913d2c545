"""Tests of the error measures on motions with known errors."""

import numpy as np
import pytest

from rigid_motion.motion import Poses, measure, rms, shell_error
from rigid_motion.motion.quaternions import normalise
from tests.motion.bodies import largest_displacements, matrices
from tests.motion.cases import random_quaternions

IDENTITY = [1.0, 0.0, 0.0, 0.0]


def test_a_shift_is_the_same_for_shell_and_position_and_has_no_velocity():
    truth = Poses(np.random.default_rng(0).normal(size=(5, 3)), random_quaternions(np.random.default_rng(1), 5))
    errors = measure(np.arange(5.0), Poses(truth.positions + np.array((0.0, 3.0, 4.0)), truth.quaternions), truth)
    assert errors.shell == pytest.approx(5.0)
    assert errors.position == pytest.approx(5.0)
    assert errors.rotation == pytest.approx(0.0, abs=1e-7)
    assert errors.velocity == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("angle", [1e-9, 0.1, np.pi / 2, np.pi])
def test_a_turn_moves_the_shell_by_the_chord(angle):
    truth = Poses([[0, 0, 0]], [IDENTITY])
    turned = Poses([[0, 0, 0]], [[np.cos(angle / 2), 0, 0, np.sin(angle / 2)]])
    errors = measure(np.zeros(1), turned, truth, radius=0.2)
    assert errors.shell[0] == pytest.approx(2 * 0.2 * np.sin(angle / 2), rel=1e-6)
    assert errors.rotation[0] == pytest.approx(angle, rel=1e-9)
    assert errors.position[0] == 0.0


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
def test_the_error_of_the_shell_is_that_of_the_farthest_point_of_the_ball(growing):
    poses, truth = pairs(300, 2, growing)
    expected = largest_displacements(matrices(poses), matrices(truth), 0.7)
    np.testing.assert_allclose(shell_error(poses, truth, radius=0.7), expected, rtol=1e-9, atol=1e-15)


def test_velocity_error_is_the_drift_per_second():
    times = np.array([0.0, 0.5, 1.5])
    truth = Poses(np.zeros((3, 3)), [IDENTITY] * 3)
    drifting = Poses(np.outer(times, (2.0, 0.0, 0.0)), [IDENTITY] * 3)
    assert measure(times, drifting, truth).velocity == pytest.approx([2.0, 2.0])


def test_rms():
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([])) == 0.0
