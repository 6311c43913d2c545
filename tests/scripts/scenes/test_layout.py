"""Tests of what is where in a film: cells of lanes, framing of motions, and points of graphs."""

from itertools import combinations

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.scenes import layout
from rigid_motion_batch.scenes.framing import Framing, Jointed, Solid
from rigid_motion_batch.scenes.timeline import peaks

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


CUBE = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])


def moving(places: np.ndarray) -> Poses:
    return Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(places), 1)))


def test_a_long_way_is_followed_and_the_object_fills_the_picture():
    way = moving(np.linspace((0.0, 0.0, 0.0), (30.0, 4.0, 1.0), 400))
    framing = Framing.of(Solid(way, CUBE), smoothing=10.0)
    assert framing.follows
    assert framing.extent(Solid(way, CUBE)).size.max() < 0.4


def test_what_has_room_where_it_is_is_not_followed():
    angles = np.linspace(0.0, 20.0, 400)
    sway = moving(0.01 * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=-1))
    framing = Framing.of(Solid(sway, CUBE), smoothing=10.0)
    assert not framing.follows
    assert np.array_equal(framing.focus, np.zeros((400, 3)))


def walking(*, climbs: float = 0.0) -> np.ndarray:
    """Return joints of a body that bobs while walking, and climbs by this many metres."""
    steps = np.linspace(0.0, 12.0, 200)
    middle = np.stack((steps, 0.0 * steps, 1.0 + 0.03 * np.sin(5.0 * steps) + climbs * steps / 12.0), axis=-1)
    return middle[:, None] + np.array([(0.0, 0.2, 0.8), (0.1, -0.2, 0.7), (0.2, 0.0, -1.0), (-0.3, 0.0, -1.0)])


def test_a_walk_is_followed_without_a_nod():
    framing = Framing.of(Jointed(walking(), np.empty((200, 0, 3))), smoothing=4.0)
    assert framing.follows
    assert np.ptp(framing.focus[:, 2]) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(framing.focus[:, 0]) > 11.0


def test_what_a_body_carries_is_seen_too() -> None:
    sword = walking()[:, :1] + np.array([(0.0, 0.0, 1.5)])
    bare, armed = (Jointed(walking(), points) for points in (sword[:, :0], sword))
    heights = [Framing.of(body, smoothing=4.0).extent(body).size[1] for body in (bare, armed)]
    assert heights[1] > heights[0] + 1.0
    assert np.array_equal(bare.middle, armed.middle)


def test_what_gets_far_from_the_recording_is_cut_and_does_not_make_it_small():
    still, lost = (Solid(moving(np.linspace((0.0, 0.0, 0.0), (x, 0.0, 0.0), 50)), CUBE) for x in (0.01, 5.0))
    framing = Framing.of(still, smoothing=10.0)
    alone, beside = framing.extent(still), framing.extent(still, [lost])
    assert (alone.cut, beside.cut) == (False, True)
    assert (beside.size < 2.0 * alone.size).all()
    assert not framing.extent(still, [still]).cut


def test_the_least_and_the_largest_of_each_column_are_kept():
    values = np.random.default_rng(5).normal(size=10_000)
    kept = peaks(values, 100)
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 202
    for column in np.split(np.arange(10_000), 100):
        here = values[kept[(kept >= column[0]) & (kept <= column[-1])]]
        assert (here.min(), here.max()) == (values[column].min(), values[column].max())
    assert np.array_equal(peaks(values[:7], 100), np.arange(7))
