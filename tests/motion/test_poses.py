"""Tests of poses and arrays of quaternions."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import packed
from rigid_motion.motion.quaternions import angle_between, conjugate, multiply, rotate
from tests.motion.bodies import matrices
from tests.motion.cases import random_quaternions


@pytest.mark.parametrize(
    "parts",
    [
        (np.zeros((4, 2)), np.zeros((4, 4))),
        (np.zeros((4, 3)), np.zeros((3, 4))),
        (np.zeros((4, 3)), np.zeros((4, 3))),
        (np.zeros((4, 3)), np.zeros((4, 4)), np.zeros(3)),
        (np.zeros((4, 3)), np.zeros((4, 4)), np.zeros((4, 1))),
    ],
)
def test_shapes_that_do_not_fit_are_refused(parts):
    with pytest.raises(ValueError, match="need the shape"):
        Poses(*parts)


def test_products_and_rotations_are_scipys():
    random = np.random.default_rng(0)
    a, b = random_quaternions(random, 100), random_quaternions(random, 100)
    points = random.normal(size=(100, 3))
    turn_a, turn_b = (Rotation.from_quat(q, scalar_first=True) for q in (a, b))
    expected = (turn_a * turn_b).as_quat(scalar_first=True)
    assert np.abs(np.abs(np.sum(multiply(a, b) * expected, axis=1)) - 1.0).max() < 1e-14
    assert rotate(a, points) == pytest.approx(turn_a.apply(points), abs=1e-14)
    assert rotate(conjugate(a), points) == pytest.approx(turn_a.inv().apply(points), abs=1e-14)
    assert angle_between(a, b) == pytest.approx((turn_a.inv() * turn_b).magnitude(), abs=1e-14)


ONE = Poses(np.arange(12.0).reshape(4, 3), np.tile((1.0, 0.0, 0.0, 0.0), (4, 1)), np.ones(4))
MANY = Poses(np.zeros((5, 4, 3)), np.zeros((5, 4, 4)))


@pytest.mark.parametrize("use", [np.asarray, np.mean, lambda poses: np.array([poses]), lambda p: np.ones(4) * p])
@pytest.mark.parametrize("poses", [ONE, MANY, ONE[0], ONE[:0]], ids=["one", "many", "single", "none"])
def test_poses_are_no_array_and_say_where_the_arrays_are(poses, use):
    with pytest.raises(TypeError, match=r"poses\.positions and poses\.quaternions"):
        use(poses)


def test_the_length_is_that_of_the_first_axis_and_so_is_what_a_loop_runs_over():
    for poses in (ONE, MANY, ONE[:0]):
        assert len(poses) == len(list(poses)) == poses.shape[0]
    assert [pose.positions.tolist() for pose in ONE] == ONE.positions.tolist()
    assert [poses.shape for poses in MANY] == [(4,)] * 5


@pytest.mark.parametrize("use", [len, list, iter, bool])
def test_a_single_pose_has_no_length_and_nothing_in_it(use):
    with pytest.raises(TypeError, match="a single pose"):
        use(ONE[0])


@pytest.mark.parametrize("scaled", [False, True])
def test_matrices_of_poses_give_these_poses_back(scaled):
    random = np.random.default_rng(2)
    scales = random.uniform(0.01, 100.0, size=(3, 50)) if scaled else None
    quaternions = random_quaternions(random, 3, 50)
    half_turns = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.5**0.5, 0.5**0.5, 0], [0, 0.6, 0, -0.8]]
    quaternions[0, : len(half_turns)] = half_turns
    poses = Poses(random.normal(size=(3, 50, 3)), quaternions, scales)
    result = Poses.from_matrices(matrices(poses))
    assert np.array_equal(result.positions, poses.positions)
    assert angle_between(result.quaternions, poses.quaternions).max() < 1e-14
    assert (result.scales is None) if not scaled else (result.scales == pytest.approx(scales, rel=1e-12))


@pytest.mark.parametrize(
    ("diagonal", "fault"), [((1, 1, -1), "mirrors"), ((1, 1, 1.01), "unevenly"), ((0, 0, 0), "no scale")]
)
def test_a_matrix_that_is_no_pose_is_named(diagonal, fault):
    matrices = np.tile(np.eye(4), (4, 1, 1))
    matrices[2, :3, :3] = np.diag(diagonal)
    with pytest.raises(ValueError, match=f"matrix at 2 .*{fault}"):
        Poses.from_matrices(matrices)


def test_a_matrix_that_was_not_tracked_is_a_pose_of_nan():
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[1] = np.nan
    poses = Poses.from_matrices(matrices)
    assert np.isnan(poses.positions[1]).all()
    assert np.isnan(poses.quaternions[1]).all()
    assert poses.scales is None


@pytest.mark.parametrize("make", [Poses.from_matrices, lambda wrong: Poses.from_xyzw(np.zeros((2, 3)), wrong)])
def test_other_shapes_are_refused_with_the_one_that_is_needed(make):
    with pytest.raises(ValueError, match=r"need the shape \(\.\.\., 4"):
        make(np.zeros((2, 3)))


def test_quaternions_with_w_last_become_those_with_w_first():
    q = random_quaternions(np.random.default_rng(3), 2, 7)
    poses = Poses.from_xyzw(np.zeros((2, 7, 3)), np.roll(q, -1, axis=-1), np.ones((2, 7)))
    assert np.array_equal(poses.quaternions, q)
    assert poses.scales is not None


@pytest.mark.parametrize("scales", [None, np.ones(100_000)], ids=["without scales", "with scales"])
def test_a_few_samples_of_a_long_recording_are_looked_up_without_a_copy_of_it(scales):
    long = packed(Poses(np.zeros((100_000, 3)), np.ones((100_000, 4)), scales))
    tracemalloc.start()
    try:
        few = long[np.array((1, 2, 3))]
        assert tracemalloc.get_traced_memory()[1] < 10_000
    finally:
        tracemalloc.stop()
    assert few.shape == (3,)
