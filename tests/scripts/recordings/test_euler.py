"""Euler angles against SciPy, whose capital letters mean turns about the turned axes."""

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings.euler import quaternions_from_intrinsic_eulers

ORDERS = ["".join(order) for count in (1, 2, 3) for order in permutations("XYZ", count)]


@pytest.mark.parametrize("order", ORDERS)
def test_turns_follow_one_another_about_the_turned_axes(order: str) -> None:
    angles = np.random.default_rng(2).uniform(-np.pi, np.pi, size=(100, len(order)))
    expected = Rotation.from_euler(order, angles).as_quat()[:, [3, 0, 1, 2]]
    assert angle_between(quaternions_from_intrinsic_eulers(angles, order), expected).max() < 1e-14


def test_no_turn_is_no_rotation() -> None:
    np.testing.assert_array_equal(quaternions_from_intrinsic_eulers(np.empty((2, 0)), ""), [[1, 0, 0, 0], [1, 0, 0, 0]])
