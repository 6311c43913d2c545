"""Tests of a tool that recorded hands hold, hand over, throw and catch."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from research.paper import holding
from research.paper.holding import KINDS, MODES, UPDATES_PER_S
from rigid_motion.motion.poses import inverse, placed
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.research.paper.clips import clip

pytestmark = pytest.mark.once


def waving(side: str, often: float) -> Clip:
    """Return a hand that swings to and fro about z, `often` times per second."""
    times = np.arange(0.0, 3.5, 1 / 120)
    angles = np.sin(2.0 * np.pi * often * times)
    return clip(f"made_{side}", times, 0.4 * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=-1), angles)


HANDS = waving("left", 1.3), waving("right", 0.9)


RATES = UPDATES_PER_S[-1:]


@cache
def measured() -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(holding, "UPDATES_PER_S", RATES)
        return holding.measure(HANDS)


@pytest.mark.parametrize("let_go", KINDS.values(), ids=KINDS)
def test_a_tool_is_one_body_with_the_hand_that_has_it_and_goes_over_without_a_jump(let_go: float):
    (change, *_) = holding._changes(*HANDS, let_go)
    times = np.linspace(-1.0, 1.0, 101)
    tool = change.poses("tool", times)
    for body, has in (("giver", times <= let_go), ("taker", times >= 0.0)):
        grips = placed(inverse(change.poses(body, times)), tool)[has]
        assert np.ptp(grips.positions, axis=0).max() < 1e-9
    before, after = change.poses("tool", np.array((-1e-9, 1e-9)))
    assert np.linalg.norm(after.positions - before.positions) < 1e-7


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
def test_a_tool_in_the_space_of_the_hand_does_not_slip_and_separate_streams_do(kind: str, mode: str):
    ways = measured()[kind][mode]
    for rate in RATES:
        assert ways["held"][rate]["held"] < 1e-9
        assert ways["held"][rate]["change"] < 1e-9
        assert ways["separate"][rate]["held"] > 1e-4


def test_a_screw_in_one_stream_holds_it_but_where_hands_change_between_updates():
    for kind in KINDS:
        ways = measured()[kind]["dq_sclerp"]
        for rate in RATES:
            assert ways["together"][rate]["held"] < 1e-9
            assert ways["together"][rate]["change"] > 1e-3
            assert ways["marked"][rate]["change"] < 1e-9
