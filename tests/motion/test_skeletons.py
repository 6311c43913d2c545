"""Tests of skeletons against matrices multiplied up each joint's chain."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.poses import inverse
from rigid_motion.motion.skeletons import AT_ONCE
from tests.motion.bodies import in_root_space, matrices, random_parents
from tests.motion.cases import random_quaternions
from tests.thoroughness import tried


def some_poses(seed: int, *shape: int, scaled: bool) -> Poses:
    random = np.random.default_rng(seed)
    scales = np.exp(random.normal(scale=0.5, size=shape)) if scaled else None
    return Poses(random.normal(size=(*shape, 3)), random_quaternions(random, *shape), scales)


@settings(max_examples=tried(80))
@given(st.integers(1, 14), st.integers(0, 2**16), st.booleans(), st.just(7))
@example(2, 0, False, AT_ONCE)
def test_joints_get_where_matrices_take_them(joints, seed, scaled, count):
    parents = random_parents(np.random.default_rng(seed), joints)
    poses = some_poses(seed, joints, count, scaled=scaled)
    there = matrices(Skeleton(parents).in_root_space(poses))
    expected = in_root_space(poses, parents)
    assert np.abs(there - expected).max() <= 1e-13 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize(
    ("parents", "message"),
    [
        ([0], "joint 0 hangs on itself"),
        ([1, 2, 3, 1], "joint 1 hangs on itself"),
        ([4, 4, -1, 2, 3, 6, 7, 6], "joint 6 hangs on itself"),
        ([-1, 2], "joint 1 has the parent 2: there are joints 0 to 1"),
        ([-1, -2, 0], "joint 1 has the parent -2: there are joints 0 to 2"),
        ([], "whole numbers, one for each joint"),
        (-1, "whole numbers, one for each joint"),
        ([-1.0, 0.0], "whole numbers, one for each joint"),
    ],
)
def test_parents_that_are_none_are_named(parents, message):
    with pytest.raises(ValueError, match=message):
        Skeleton(parents)


@pytest.mark.parametrize("scaled", [False, True])
def test_an_inverse_is_that_of_the_matrix(scaled):
    poses = some_poses(5, 40, scaled=scaled)
    assert np.abs(matrices(inverse(poses)) - np.linalg.inv(matrices(poses))).max() < 1e-12
