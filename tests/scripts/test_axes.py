"""Tests of conversions between axis conventions and Blender's axes, against rotation matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion_batch.axes import AXES, DESCRIBED, NERF, from_blender, to_blender


def matrices(poses: Poses) -> np.ndarray:
    return Rotation.from_quat(poses.quaternions[:, [1, 2, 3, 0]]).as_matrix()


@pytest.fixture
def poses() -> Poses:
    random = np.random.default_rng(5)
    quaternions = random.normal(size=(50, 4))
    return Poses(
        random.normal(size=(50, 3)),
        quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        random.uniform(0.5, 2.0, size=50),
    )


@pytest.mark.parametrize("axes", AXES)
def test_a_rotation_becomes_the_one_of_the_changed_matrix(poses: Poses, axes: str) -> None:
    change = AXES[axes]
    np.testing.assert_allclose(matrices(to_blender(poses, axes)), change @ matrices(poses) @ change.T, atol=1e-14)


@pytest.mark.parametrize(
    ("axes", "up", "forward", "right"),
    [
        ("blender", (0, 0, 1), (0, 1, 0), (1, 0, 0)),
        ("opengl", (0, 1, 0), (0, 0, -1), (1, 0, 0)),
        ("unity", (0, 1, 0), (0, 0, 1), (1, 0, 0)),
        ("ros", (0, 0, 1), (1, 0, 0), (0, -1, 0)),
        ("unreal", (0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ("opencv", (0, -1, 0), (0, 0, 1), (1, 0, 0)),
    ],
)
def test_up_is_z_forward_is_y_and_right_is_x(axes: str, up: tuple, forward: tuple, right: tuple) -> None:
    still = np.tile((1.0, 0.0, 0.0, 0.0), (3, 1))
    converted = to_blender(Poses(np.array((right, forward, up), dtype=float), still), axes)
    np.testing.assert_array_equal(converted.positions, np.eye(3))


def test_unknown_axes_are_answered_with_the_known_ones(poses: Poses) -> None:
    with pytest.raises(ValueError, match="'maya'; known are blender, opengl, unity, ros, unreal, opencv"):
        to_blender(poses, "maya")


@pytest.mark.parametrize("axes", DESCRIBED)
def test_there_and_back(poses: Poses, axes: str) -> None:
    back = from_blender(to_blender(poses, axes), axes)
    np.testing.assert_allclose(back.positions, poses.positions, atol=1e-15)
    np.testing.assert_allclose(back.quaternions, poses.quaternions, atol=1e-15)
    assert {*DESCRIBED} == {*AXES, NERF}
