"""Tests of the figure with the throw and the catch."""

from functools import cache

import numpy as np
import pytest

from research.paper import catching
from research.paper.catching import CATCH, GRIP_M, HELD, RELEASE, UPDATES_PER_S
from rigid_motion.motion.quaternions import angle_between, rotate
from tests.scripts.research.paper.clips import thrown

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


@cache
def views() -> dict[str, dict[int, dict[str, float]]]:
    return catching.figures(thrown())


def test_a_hand_that_holds_the_tool_is_one_body_with_it():
    times, poses = catching.bodies(thrown())
    tool = poses["tool"]
    for hand, held in (("thrower", times <= RELEASE), ("catcher", times >= CATCH)):
        wrist = tool.positions + rotate(tool.quaternions, np.broadcast_to(GRIP_M, tool.positions.shape))
        np.testing.assert_allclose(poses[hand].positions[held], wrist[held], atol=1e-9)
        assert angle_between(poses[hand].quaternions, tool.quaternions)[held].max() < 1e-6


def test_a_screw_keeps_the_tool_in_the_hand_that_holds_it_and_the_state_of_the_art_does_not():
    for rate in UPDATES_PER_S:
        assert views()["lerp_slerp"][rate]["slip"] > 1e-3
        for mode in ("dq_sclerp", "pga_lerp", "motor_spline"):
            assert views()[mode][rate]["slip"] < 1e-9


def test_a_tool_in_the_space_of_the_hand_neither_slips_nor_is_caught_beside_the_hand():
    for view in views()[HELD].values():
        assert max(view["slip"], view["gap"], view["mean_gap"]) < 1e-9


def test_a_tool_in_the_space_of_the_hand_flies_as_its_updates_say():
    times, poses = catching.bodies(thrown())
    flying = times[(times > RELEASE) & (times < CATCH - catching.PASS_S)]
    held, moved = (catching.shown_of(times, poses, 20, mode, flying)["tool"] for mode in (HELD, catching.MOVED))
    inner = (flying > flying[0] + 0.05) & (flying < flying[-1] - 0.05)
    np.testing.assert_allclose(held.positions[inner], moved.positions[inner], atol=1e-9)
