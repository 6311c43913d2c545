"""The measures of error, on motions whose errors are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses, measure, rms, shell_error
from rigid_motion.motion.quaternions import normalise
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
    """Poses near one another and far apart, in place, in rotation and in scale."""
    random = np.random.default_rng(seed)
    near, nearer, nearest = 10.0 ** random.uniform((-6, -6, -8), (1, 1, 0), (count, 3)).T[..., None]
    truth = random.normal(size=(count, 3)), random_quaternions(random, count)
    quaternions = normalise(truth[1] + nearer * random.normal(size=(count, 4)))
    scales = np.exp(random.normal(size=count)) if growing else None
    grown = scales * np.exp(nearest[:, 0] * random.normal(size=count)) if growing else None
    return Poses(truth[0] + near * random.normal(size=(count, 3)), quaternions, grown), Poses(*truth, scales)


def displacements(poses: Poses, truth: Poses, points: np.ndarray) -> np.ndarray:
    """How far points (m, 3) of the body, the same for all poses (n,), are off by SciPy's rotations, shape (n, m)."""

    def placed(some: Poses) -> np.ndarray:
        matrices = Rotation.from_quat(some.quaternions, scalar_first=True).as_matrix()
        scales = np.ones(len(some)) if some.scales is None else some.scales
        return some.positions[:, None] + np.einsum("n,nij,mj->nmi", scales, matrices, points)

    return np.linalg.norm(placed(poses) - placed(truth), axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("growing", [False, True])
def test_no_point_of_the_ball_is_off_by_more_and_one_is_off_by_as_much(growing):
    poses, truth = pairs(300, 2, growing)
    random = np.random.default_rng(3)
    directions = random.normal(size=(20000, 3))
    points = 0.7 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    error = shell_error(poses, truth, radius=0.7)
    result = displacements(poses, truth, points)
    assert np.all(result.max(axis=1) <= error * (1.0 + 1e-12) + 1e-15)
    assert np.all(result.max(axis=1) >= 0.999 * error)
    inside = displacements(poses, truth, points * random.uniform(size=(20000, 1)))
    assert np.all(inside.max(axis=1) <= error * (1.0 + 1e-12) + 1e-15)


def test_velocity_error_is_the_drift_per_second():
    times = np.array([0.0, 0.5, 1.5])
    truth = Poses(np.zeros((3, 3)), [IDENTITY] * 3)
    drifting = Poses(np.outer(times, (2.0, 0.0, 0.0)), [IDENTITY] * 3)
    assert measure(times, drifting, truth).velocity == pytest.approx([2.0, 2.0])


def test_rms():
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert rms(np.array([])) == 0.0
