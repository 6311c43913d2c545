import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.scenes.layout import largest_deviation, magnification


@pytest.mark.parametrize(
    ("deviation", "factor"), [(0.0, 1.0), (1e-5, 2000.0), (1e-3, 20.0), (0.004, 5.0), (0.021, 1.0), (3.0, 1.0)]
)
def test_the_factor_is_a_round_number(deviation, factor):
    assert magnification(deviation, 0.1) == factor


def test_the_largest_deviation_is_that_of_the_farthest_point():
    still = Poses(np.zeros((2, 3)), np.eye(4)[[0, 0]])
    turned = Poses(np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.3]]), np.eye(4)[[0, 3]])
    assert largest_deviation(turned, still, np.eye(3)) == pytest.approx(np.hypot(2.0, 0.3))
