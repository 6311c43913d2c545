from itertools import combinations

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.scenes import layout

SHAPES = {"wide": (3.0, 0.4), "tall": (0.3, 2.0), "square": (1.0, 1.0), "tiny": (1e-3, 2e-3), "huge": (400.0, 90.0)}
ASPECTS = {"16:9": 16 / 9, "4:3": 4 / 3, "portrait": 9 / 16}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("aspect", ASPECTS)
@pytest.mark.parametrize("lanes", [1, 2, 3, 5, 6, 8, 12])
def test_the_motion_fits_its_cell_and_cells_keep_to_themselves(lanes, shape, aspect):
    plan = layout.arrange(lanes, np.array(SHAPES[shape]), ASPECTS[aspect])
    assert len(plan.cells) == lanes
    for cell in plan.cells:
        half = np.array(SHAPES[shape]) / plan.metres / 2.0
        assert np.all(half <= cell.room / 2.0 + 1e-12)
        assert abs(cell.view[0] - cell.x) + half[0] < cell.width / 2.0
        assert cell.view[1] + half[1] < cell.foot + cell.height - cell.head + 1e-12
        assert cell.view[1] - half[1] > cell.foot + cell.unit * layout.CARD_FOOT_RATIO - 1e-12
        assert abs(cell.x) + cell.width / 2.0 < ASPECTS[aspect] / 2.0
        assert abs(cell.y) + cell.height / 2.0 < 0.5
    for one, other in combinations(plan.cells, 2):
        assert max(abs(one.x - other.x) - one.width, abs(one.y - other.y) - one.height) > layout.GAP_RATIO - 1e-12


def test_the_broad_side_of_the_motion_faces_the_camera():
    random = np.random.default_rng(3)
    points = random.normal(size=(500, 3)) * (5.0, 0.5, 8.0)
    turned = rotate(layout.yaw_quaternion(1.1), points)
    seen = rotate(layout.yaw_quaternion(layout.heading(turned)), turned)
    assert np.std(seen[:, 0]) == pytest.approx(np.std(points[:, 0]), rel=0.01)
    assert np.allclose(seen[:, 2], points[:, 2])


@pytest.mark.parametrize(
    ("deviation", "factor"), [(0.0, 1.0), (1e-5, 2000.0), (1e-3, 20.0), (0.004, 5.0), (0.021, 1.0), (3.0, 1.0)]
)
def test_the_factor_is_a_round_number(deviation, factor):
    assert layout.magnification(deviation, 0.1) == factor


def test_the_largest_deviation_is_that_of_the_farthest_point():
    still = Poses(np.zeros((2, 3)), np.eye(4)[[0, 0]])
    turned = Poses(np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.3]]), np.eye(4)[[0, 3]])
    assert layout.largest_deviation(turned, still, np.eye(3)) == pytest.approx(np.hypot(2.0, 0.3))
