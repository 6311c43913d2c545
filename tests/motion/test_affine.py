"""Tests of the errors of affine maps: one by one as among many, and by bounds as by all maps."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion.affine import AffineMaps, ball_displacement, displacement_over, largest_displacement
from rigid_motion.motion.quaternions import matrices
from tests.motion.cases import random_quaternions

COUNT = 200


@pytest.mark.parametrize("size", [1.9007093261133585, 0.7157361225108096, 1.3149344159092364])
def test_a_ball_of_which_the_square_is_rounded_otherwise_alone_is_off_as_far_as_among_many(size):
    shrunk, whole = AffineMaps(np.diag((0.0, 0.0, 1.0)), np.zeros(3)), AffineMaps(np.eye(3), np.zeros(3))
    assert float(ball_displacement(shrunk, whole, size)) == pytest.approx(size)


def test_the_largest_and_those_over_a_limit_are_found_by_bounds():
    """Of maps of balls that are all turned about their origins, and half of them also moved, stretched and sheared."""
    random = np.random.default_rng(3)
    turned = [np.moveaxis(matrices(random_quaternions(random, COUNT)), -1, 0) for _ in range(2)]
    shear, moved = random.normal(size=(COUNT, 3, 3)), random.normal(size=(COUNT, 3))
    moved[::2], shear[::2] = 0.0, np.eye(3)
    maps, truth = AffineMaps(turned[0] @ shear, moved), AffineMaps(turned[1], np.zeros((COUNT, 3)))
    radii = random.uniform(0, 1, COUNT)
    every = ball_displacement(maps, truth, radii)
    assert largest_displacement(maps, truth, radii) == every.max()
    limit = float(np.median(every))
    over = displacement_over(maps, truth, radii, limit)
    assert np.array_equal(over > limit, every > limit)
    assert np.array_equal(over[every > limit], every[every > limit])
