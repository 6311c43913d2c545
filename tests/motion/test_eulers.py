"""Tests of Euler angles: the rotations are SciPy's, and the angles are continuous."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.eulers import ORDERS, extrinsic_eulers_from_quaternions, quaternions_from_extrinsic_eulers
from tests.motion.cases import random_quaternions

in_every_order = pytest.mark.parametrize("order", ORDERS)


def rotations(angles: np.ndarray, order: str) -> Rotation:
    """Return SciPy's rotations; its lower-case orders turn about fixed axes, one after the other."""
    return Rotation.from_euler(order.lower(), angles[:, ["XYZ".index(axis) for axis in order]])


def assert_same_rotations(angles: np.ndarray, order: str, quaternions: np.ndarray, tolerance: float = 1e-12) -> None:
    expected = Rotation.from_quat(quaternions, scalar_first=True)
    assert (expected.inv() * rotations(angles, order)).magnitude().max() < tolerance


@in_every_order
def test_angles_of_any_size_give_scipys_rotations(order):
    right_angles = np.array(list(itertools.product(0.5 * np.pi * np.arange(-8.0, 9.0), repeat=3)))
    angles = np.concatenate((right_angles, np.random.default_rng(3).normal(scale=20.0, size=(2000, 3))))
    expected = rotations(angles, order).as_quat(scalar_first=True)
    quaternions = quaternions_from_extrinsic_eulers(angles, order)
    assert np.abs(np.linalg.norm(quaternions, axis=1) - 1.0).max() < 1e-15
    assert np.abs(quaternions - expected * np.sign(np.sum(quaternions * expected, axis=1))[:, None]).max() < 1e-13


@in_every_order
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_turning_on_and_on_about_one_axis_is_one_rising_angle(order, axis):
    turns = np.linspace(0.0, 6.0 * np.pi, 400)
    quaternions = np.zeros((400, 4))
    quaternions[:, 0], quaternions[:, 1 + axis] = np.cos(turns / 2.0), np.sin(turns / 2.0)
    quaternions[::3] *= -1.0
    expected = np.zeros((400, 3))
    expected[:, axis] = turns
    assert extrinsic_eulers_from_quaternions(quaternions, order) == pytest.approx(expected, abs=1e-7)


@in_every_order
def test_motions_have_no_jumps(order):
    keys = Poses(np.zeros((20, 3)), random_quaternions(np.random.default_rng(2), 20))
    frames = np.linspace(0.0, 19.0, 20_000)
    quaternions = interpolate(np.arange(20.0), keys, frames, "dq_sclerp").quaternions
    angles = extrinsic_eulers_from_quaternions(quaternions, order)
    assert np.abs(np.diff(angles, axis=0)).max() < 0.3
    assert_same_rotations(angles, order, quaternions)


@in_every_order
def test_straight_through_gimbal_lock(order):
    middle = "XYZ".index(order[1])
    angles = np.full((201, 3), 0.3)
    angles[:, middle] = np.linspace(1.0, np.pi - 1.0, 201)  # The middle angle is exactly a right angle.
    quaternions = rotations(angles, order).as_quat(scalar_first=True)
    result = extrinsic_eulers_from_quaternions(quaternions, order)
    assert_same_rotations(result, order, quaternions, 1e-7)
    assert np.abs(np.diff(result, axis=0)).max() < 0.02


def test_resting_in_gimbal_lock_is_a_rest():
    quaternion = Rotation.from_euler("xyz", [0.4, np.pi / 2.0, 0.1]).as_quat(scalar_first=True)
    angles = extrinsic_eulers_from_quaternions(np.tile(quaternion, (5, 1)), "XYZ")
    assert np.ptp(angles, axis=0) == pytest.approx(0.0, abs=1e-12)
    assert_same_rotations(angles, "XYZ", np.tile(quaternion, (5, 1)), 1e-7)
