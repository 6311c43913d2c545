"""Tests of the table on clips with known results."""

import numpy as np
import pytest

from research.paper import table
from research.paper.table import UPDATES
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.research.paper.clips import circling

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
