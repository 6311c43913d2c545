"""Which keys have a say at a moment, of those that are known by then."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper.streaming.known_keys import NONE, KnownKeys
from rigid_motion.motion import MODES
from tests.scripts.research.paper.streaming.motions import swinging

ALL_KNOWN = 100.0


def keys(mode: str, known_from: list[float]) -> KnownKeys:
    """Keys at 0, 1, 2 ... that become known at these times."""
    _, poses = swinging()
    return KnownKeys(np.arange(float(len(known_from))), poses[: len(known_from)], np.array(known_from), mode, 1.0, 0.3)


def window(mode: str, known_from: list[float], moment: float, now: float) -> list[int]:
    return keys(mode, known_from).windows(np.array([moment]), np.array([now]))[0].tolist()


@pytest.mark.parametrize("mode", MODES)
def test_a_mode_sees_as_many_keys_behind_and_ahead_as_it_says(mode):
    behind, ahead = MODES[mode].behind, MODES[mode].ahead
    seen = [key for key in window(mode, [0.0] * 9, 4.5, ALL_KNOWN) if key != NONE]
    assert seen == list(range(4 - behind, 6 + ahead))


@pytest.mark.parametrize("mode", MODES)
def test_keys_that_are_not_known_yet_are_passed_over(mode):
    behind, ahead = MODES[mode].behind, MODES[mode].ahead
    known_from = [0.0, 9.0, 0.0, 9.0, 0.0, 9.0, 0.0, 9.0, 0.0]
    seen = [key for key in window(mode, known_from, 4.5, 8.0) if key != NONE]
    assert seen == list(range(4 - 2 * behind, 8 + 2 * ahead, 2))


@pytest.mark.parametrize("mode", MODES)
def test_before_the_first_key_it_is_alone(mode):
    assert [key for key in window(mode, [9.0, 9.0, 0.0, 0.0, 0.0], 0.5, 8.0) if key != NONE] == [2]


@pytest.mark.parametrize("mode", MODES)
def test_beyond_the_newest_key_the_one_before_says_where_it_was_going(mode):
    assert [key for key in window(mode, [0.0, 0.0, 0.0, 9.0, 9.0], 7.0, 8.0) if key != NONE] == [1, 2]
    assert [key for key in window(mode, [0.0, 9.0, 9.0], 7.0, 8.0) if key != NONE] == [0]


@pytest.mark.parametrize("mode", MODES)
def test_a_key_that_is_shown_at_its_moment_is_met(mode):
    found = keys(mode, [0.0] * 9)
    moments = np.arange(9.0)
    poses = found.poses_at(moments, found.windows(moments, np.full(9, ALL_KNOWN)))
    assert poses.positions == pytest.approx(found.poses.positions, abs=1e-12)
