"""The measures of error, on motions whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addon.motion import Poses, measure, rms, shell_error
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


def test_the_shell_is_that_of_three_points_moved_by_scipys_rotations():
    random = np.random.default_rng(2)
    a, b = (Poses(random.normal(size=(50, 3)), random_quaternions(random, 50)) for _ in range(2))
    expected = np.zeros(50)
    for axis in np.eye(3):
        points = [p.positions + Rotation.from_quat(p.quaternions, scalar_first=True).apply(0.1 * axis) for p in (a, b)]
        expected = np.maximum(expected, np.linalg.norm(points[0] - points[1], axis=1))
    assert shell_error(a, b) == pytest.approx(expected, rel=1e-12)


def test_growth_moves_the_shell():
    truth = Poses([[0, 0, 0]], [IDENTITY], [1.0])
    assert shell_error(Poses([[0, 0, 0]], [IDENTITY], [3.0]), truth, radius=0.5)[0] == pytest.approx(1.0)


def test_the_sign_of_a_quaternion_is_no_error():
    truth = Poses([[0, 0, 0]], [IDENTITY])
    errors = measure(np.zeros(1), Poses([[0, 0, 0]], [[-1.0, 0, 0, 0]]), truth)
    assert errors.rotation[0] == 0.0
    assert errors.shell[0] == 0.0


def test_velocity_error_is_the_drift_per_second():
    times = np.array([0.0, 0.5, 1.5])
    truth = Poses(np.zeros((3, 3)), [IDENTITY] * 3)
    drifting = Poses(np.outer(times, (2.0, 0.0, 0.0)), [IDENTITY] * 3)
    assert measure(times, drifting, truth).velocity == pytest.approx([2.0, 2.0])


def test_rms():
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([])) == 0.0
