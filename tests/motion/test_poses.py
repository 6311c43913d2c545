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
