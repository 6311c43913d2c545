"""Tests of ground contacts: which joints stand and how far they slide, on known motions."""

import numpy as np
import pytest

from rigid_motion.motion.contacts import slide, slide_ratios, standing

TIMES = np.arange(90) / 30.0
HEIGHTS = np.array((1.7, 1.0, 0.05))


def body(foot: np.ndarray) -> np.ndarray:
    """Return positions of a head and a hip that move forward, and of the given foot (n, 3)."""
    forwards = np.stack((0.8 * TIMES, 0.0 * TIMES, 0.0 * TIMES), axis=1)
    head, hip = (forwards + np.array((0.0, 0.0, height)) for height in HEIGHTS[:2])
    return np.stack((head, hip, foot))


def stepping(stands: np.ndarray, drift: float = 0.0) -> np.ndarray:
    """Return a foot that moves forward at 2 m/s, or at the speed `drift` while it stands."""
    ways = np.where(stands, drift / 30.0, 2.0 / 30.0)
    return np.stack((np.cumsum(ways), 0.0 * ways, np.full(len(ways), HEIGHTS[2])), axis=1)


@pytest.mark.parametrize(("noise", "share"), [(0.0, 0.9), (0.003, 0.7)])
def test_a_foot_that_stops_stands_if_it_jitters_too_and_nothing_else_does(noise, share):
    stops = (TIMES > 0.5) & (TIMES < 1.5)
    positions = body(stepping(stops)) + noise * np.random.default_rng(1).normal(size=(3, 90, 3))
    assert standing(TIMES, positions).any() == (noise == 0.0)
    stands = standing(TIMES, positions, shaky=noise > 0.0)
    assert not stands[:2].any()
    assert np.all(stands[2] <= stops)
    assert np.count_nonzero(stands[2]) > share * np.count_nonzero(stops)


@pytest.mark.parametrize(("drift", "does"), [(0.05, True), (0.2, False)])
def test_what_slides_slowly_still_stands(drift, does):
    assert standing(TIMES, body(stepping(np.full(90, True), drift)))[2].any() == does


def test_neither_a_hand_that_is_held_still_stands_nor_what_only_turns_back():
    foot = stepping(np.full(90, False))
    foot[:, 0] = 0.1 * np.sin(5.0 * TIMES)
    still = np.tile((0.0, 0.0, 0.9), (90, 1))
    assert not standing(TIMES, np.concatenate((body(foot), still[None])))[2:].any()


def test_a_body_of_another_size_stands_as_long():
    positions = body(stepping(TIMES > 1.0, 0.03))
    assert np.array_equal(standing(TIMES, positions), standing(TIMES, 100.0 * positions))


def test_one_sample_is_no_standing():
    assert not standing(TIMES[:1], body(stepping(np.full(90, True)))[:, :1]).any()


def test_the_slide_is_the_farthest_from_where_it_stood_at_first():
    positions = body(stepping(TIMES > 1.0, 0.03))
    stands = np.zeros((3, 90), dtype=bool)
    stands[2, 40:71] = True
    assert slide(positions, stands) == pytest.approx(0.03)
    assert slide(positions, np.zeros_like(stands)) == 0.0


def test_how_far_it_slides_is_told_of_each_contact_by_what_it_did_there():
    before, after = body(stepping(np.full(90, False))), body(stepping(np.full(90, True)))
    stands = np.zeros((3, 90), dtype=bool)
    stands[2, 10:21] = stands[2, 40:45] = True
    before[2, 10:21, 0], before[2, 40:45, 0] = np.linspace(0.0, 0.1, 11), 0.2
    after[2, 10:21, 0], after[2, 40:45, 0] = np.linspace(0.0, -0.3, 11), 0.4
    ratios = slide_ratios(after, before, stands)
    assert ratios[2, 10:21] == pytest.approx([3.0, *np.linspace(0.3, 3.0, 10)], rel=1e-6)
    assert np.count_nonzero(ratios) == 11
