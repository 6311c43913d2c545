import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion_batch.scenes.layout import largest_deviation, magnification, magnified

RANDOM = np.random.default_rng(8)
MIDDLE = np.array((0.03, -0.1, 0.05))
POINTS = MIDDLE + RANDOM.normal(size=(40, 3)) * 0.1


def some_poses(count: int = 50, scales: bool = False) -> Poses:
    turns = Rotation.random(count, random_state=4).as_quat()[:, [3, 0, 1, 2]]
    return Poses(RANDOM.normal(size=(count, 3)), turns, RANDOM.uniform(0.5, 2.0, count) if scales else None)


def beside(poses: Poses, offset: float, angle: float) -> Poses:
    turns = Rotation.from_rotvec(angle * RANDOM.normal(size=(len(poses), 3)))
    turned = (turns * Rotation.from_quat(poses.quaternions[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
    signs = RANDOM.choice((-1.0, 1.0), len(poses))[:, None]
    return Poses(poses.positions + offset * RANDOM.normal(size=(len(poses), 3)), signs * turned, poses.scales)


def test_what_is_drawn_is_as_large_as_the_object_at_most():
    truth = some_poses()
    shown = beside(truth, 1e-3, 2e-3)
    factor = magnification(largest_deviation(shown, truth, POINTS), float(np.ptp(POINTS, axis=0).max()))
    assert factor > 1.0
    drawn = largest_deviation(magnified(shown, truth, factor, MIDDLE), truth, POINTS)
    assert drawn < 0.45 * np.ptp(POINTS, axis=0).max()


@pytest.mark.parametrize(
    ("deviation", "factor"), [(0.0, 1.0), (1e-5, 2000.0), (1e-3, 20.0), (0.004, 5.0), (0.021, 1.0), (3.0, 1.0)]
)
def test_the_factor_is_a_round_number(deviation, factor):
    assert magnification(deviation, 0.1) == factor
