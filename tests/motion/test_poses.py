"""Poses and arrays of quaternions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs, angle_between, conjugate, multiply, rotate
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


def test_indexing_keeps_the_parts_together():
    poses = Poses(np.arange(12.0).reshape(4, 3), np.arange(16.0).reshape(4, 4), np.arange(4.0))
    some = poses[[3, 0]]
    assert len(some) == 2
    assert some.positions[0].tolist() == [9, 10, 11]
    assert some.scales.tolist() == [3, 0]


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


def test_signs_follow_from_the_first_on():
    q = random_quaternions(np.random.default_rng(1), 3, 50)
    aligned = align_signs(q)
    assert np.all(np.sum(aligned[:, 1:] * aligned[:, :-1], axis=-1) >= 0.0)
    assert np.array_equal(aligned[:, 0], q[:, 0])
    assert np.array_equal(np.abs(aligned), np.abs(q))


ONE = Poses(np.arange(12.0).reshape(4, 3), np.tile((1.0, 0.0, 0.0, 0.0), (4, 1)), np.ones(4))
MANY = Poses(np.zeros((5, 4, 3)), np.zeros((5, 4, 4)))


@pytest.mark.parametrize(
    "use",
    [
        np.asarray,
        lambda poses: np.asarray(poses, dtype=object),
        lambda poses: np.array([poses, poses]),
        lambda poses: np.mean(poses),
        lambda poses: np.concatenate([poses, poses]),
        lambda poses: np.array_equal(poses, poses),
        lambda poses: np.isfinite(poses),
        lambda poses: np.ones(4) * poses,
        lambda poses: np.ones(4)[poses],
    ],
)
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


def test_an_index_beyond_the_leading_axes_is_refused():
    for index in (4, (0, 0), ([True] * 3,), "positions", 1.5):
        with pytest.raises(IndexError):
            ONE[index]


def test_a_slice_is_a_view_and_a_list_of_numbers_is_a_copy():
    poses = ONE.copy()
    poses[1:].positions[0] = -1.0
    poses[[2]].positions[0] = -1.0
    assert poses.positions.tolist() == [[0, 1, 2], [-1, -1, -1], [6, 7, 8], [9, 10, 11]]
