"""Tests of the paper's studies on clips with known results."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from research.paper import holding, table
from research.paper.holding import KINDS, MODES, UPDATES_PER_S
from research.paper.table import UPDATES
from rigid_motion.motion.poses import inverse, placed
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.research.paper.clips import circling, clip

pytestmark = pytest.mark.once


@pytest.mark.parametrize("turns", [0.0, 1.0], ids=["along a circle", "about a pivot"])
def test_a_screw_is_the_straight_line_or_tells_which_way_it_turns(turns: float, monkeypatch: pytest.MonkeyPatch):
    straight, screw = modes = table.REFERENCE, table.SCREW
    monkeypatch.setattr(table, "MODES", modes)
    monkeypatch.setattr(table, "ROW_CHOICES", {mode: (mode, table.DECIMATIONS[0]) for mode in modes})
    clip = circling(turns=turns, rate=120.0)
    needed = table.needed(clip)
    assert needed[straight] == pytest.approx([1.0] * 4)
    for rate, share in zip(UPDATES, needed[screw], strict=True):
        # A pivot of 1.6 turns: with four segments each is less than half a turn.
        keys = rate * clip.times[-1] + 1.0
        assert share * keys == pytest.approx(5.0 if turns else keys, rel=0.01)


def test_means_are_geometric_and_over_the_clips_that_got_there():
    nan = np.nan
    mean = table.means([[0.25, nan, nan, nan], [1.0, nan, nan, np.inf], [np.inf, nan, nan, nan], [nan] * 4])
    assert mean["updates"][0] == pytest.approx(15.0)
    assert mean["saved"][0] == pytest.approx(0.5)
    assert (mean["reached"].tolist(), mean["asked"].tolist()) == ([2, 0, 0, 0], [3, 0, 0, 1])
    assert np.isnan(mean["saved"][3])


@pytest.mark.parametrize("seed", range(8))
def test_the_screw_is_nearer_exactly_where_more_than_half_of_the_bow_is_there(seed: int):
    result = table.bows_of(swinging_clip(seed=seed))
    assert result
    for share, error in result.values():
        assert (share > 0.5) == (error < 1.0)


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
