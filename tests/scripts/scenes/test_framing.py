import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.scenes.framing import Framing, Jointed, Solid

CUBE = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
STILL = (1.0, 0.0, 0.0, 0.0)


def moving(places: np.ndarray) -> Poses:
    return Poses(places, np.tile(STILL, (len(places), 1)))


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
