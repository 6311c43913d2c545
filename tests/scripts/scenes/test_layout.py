from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.scenes import layout

SHAPES = {"wide": (3.0, 0.4), "tall": (0.3, 2.0), "square": (1.0, 1.0), "tiny": (1e-3, 2e-3), "huge": (400.0, 90.0)}
ASPECTS = {"16:9": 16 / 9, "4:3": 4 / 3, "portrait": 9 / 16}


def standing(positions) -> Poses:
    return Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (len(positions), 1)))


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
        assert cell.view[1] - half[1] > cell.foot + cell.unit * layout.FOOT - 1e-12
        assert abs(cell.x) + cell.width / 2.0 < ASPECTS[aspect] / 2.0
        assert abs(cell.y) + cell.height / 2.0 < 0.5
    for one, other in combinations(plan.cells, 2):
        assert max(abs(one.x - other.x) - one.width, abs(one.y - other.y) - one.height) > layout.GAP - 1e-12


def test_a_tall_motion_stands_in_one_row_and_a_wide_one_in_several():
    rows = {
        shape: len({cell.y for cell in layout.arrange(6, np.array(SHAPES[shape]), 16 / 9).cells})
        for shape in ("tall", "wide")
    }
    assert rows["tall"] == 1
    assert rows["wide"] > 1


def test_no_other_arrangement_shows_motion_and_letters_much_larger():
    extent = np.array(SHAPES["square"])

    def size(plan: layout.Layout) -> float:
        return plan.cells[0].unit / plan.metres

    others = [size(layout._arranged(6, rows, extent, 16 / 9, False)) for rows in range(1, 7)]
    assert size(layout.arrange(6, extent, 16 / 9)) >= layout.WRAP_GAIN * max(others)


def test_the_broad_side_of_the_motion_faces_the_camera():
    random = np.random.default_rng(3)
    points = random.normal(size=(500, 3)) * (5.0, 0.5, 8.0)
    turned = rotate(layout.yaw_quaternion(1.1), points)
    seen = rotate(layout.yaw_quaternion(layout.heading(turned)), turned)
    assert np.std(seen[:, 0]) == pytest.approx(np.std(points[:, 0]), rel=0.01)
    assert np.allclose(seen[:, 2], points[:, 2])


def test_the_camera_turns_by_no_more_than_a_quarter():
    for angle in np.linspace(0.0, 2.0 * np.pi, 25):
        line = np.array((np.cos(angle), np.sin(angle), 0.0)) * np.linspace(-1.0, 1.0, 9)[:, None]
        assert abs(layout.heading(line)) <= np.pi / 2.0 + 1e-9


def test_what_is_seen_leads_back_to_the_stage():
    points = np.random.default_rng(1).normal(size=(20, 3))
    assert np.allclose(layout.unproject(layout.project(points)), points)


def test_up_in_the_world_is_up_in_the_frame():
    right, up, _ = layout.project(np.array((0.0, 0.0, 1.0)))
    assert right == 0.0
    assert up > 0.9


def test_the_outermost_points_span_all_points():
    random = np.random.default_rng(2)
    cloud = random.normal(size=(20_000, 3)) * (1.0, 0.2, 3.0)
    few = layout.outermost(cloud)
    directions = random.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lost = (cloud @ directions.T).max(axis=0) - (few @ directions.T).max(axis=0)
    assert len(few) < 1000
    assert lost.max() < 0.003 * np.ptp(cloud, axis=0).max()


def test_swept_points_turn_move_and_grow_with_the_poses():
    quarter = np.sqrt(0.5)
    poses = Poses([(0, 0, 0), (1, 2, 3)], [(1, 0, 0, 0), (quarter, 0, 0, quarter)], [1.0, 2.0])
    assert np.allclose(layout.swept_points(poses, np.array([(0.5, 0.0, 0.0)])), [(0.5, 0, 0), (1, 3, 3)])


def test_the_object_grows_only_on_paths_much_longer_than_itself():
    path = np.array([(0.0, 0.0, 0.0), (100.0, 1.0, 0.0)])
    assert layout.display_scale(path, 0.2) == pytest.approx(100.0 / (layout.SHOWN_RATIO * 0.2))
    assert layout.display_scale(path * 1e-3, 0.2) == 1.0


def test_the_path_of_the_tip_is_drawn():
    points = np.array([(0.0, 0.3, 0.0), (0.1, 0.0, 0.0)])
    assert np.array_equal(layout.telling_point(standing(np.linspace((0, 0, 0), (1, 0, 0), 5)), points), points[0])


def test_of_a_tool_that_pivots_about_its_tip_another_point_is_drawn():
    tip, handle = np.array((0.0, 0.3, 0.0)), np.array((0.0, -0.1, 0.0))
    angles = np.linspace(-0.5, 0.5, 20)
    turns = np.stack((np.cos(angles / 2), np.sin(angles / 2), 0 * angles, 0 * angles), axis=-1)
    pivoting = Poses(-rotate(turns, np.tile(tip, (20, 1))), turns)
    assert np.array_equal(layout.telling_point(pivoting, np.stack((tip, handle))), handle)
