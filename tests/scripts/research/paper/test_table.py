"""The table on clips of which the answer is known."""

import numpy as np
import pytest

from research.paper import table
from research.paper.table import UPDATES
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.research.paper.clips import circling, spinning_straight

FIRST = next(iter(table.YARDSTICKS))


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "STEP", 1.1)
    monkeypatch.setattr(table, "TOLERANCES", (0.5, 2.0, 3))


def needed(clip: Clip) -> dict[str, dict[str, dict[int, float]]]:
    return table.needed(clip, table.curves_of(clip))


def test_the_lowest_rate_is_the_first_that_is_good_enough_also_where_a_higher_one_is_not():
    rates, errors = np.array((5.0, 10.0, 20.0, 30.0)), np.array((4.0, 1.0, 3.0, 0.5))
    assert table.lowest(rates, errors, 1.0) == 10.0
    assert table.lowest(rates, errors, 2.0) == pytest.approx(5.0 * 2.0**0.5)
    assert table.lowest(rates, errors, 0.4) == np.inf
    assert table.lowest(rates[::-1], errors[::-1], 9.0) == 5.0


def test_on_a_pivot_a_screw_is_as_good_at_the_lowest_rate_that_is_tried():
    for own in needed(circling("pivot", turns=1.0)).values():
        for rate in UPDATES:
            assert rate * own["dq_sclerp"][rate] == pytest.approx(table.LOWEST, rel=0.02)


def test_on_a_circle_without_turning_the_screw_is_the_straight_line():
    clip = circling(turns=0.0)
    for own in needed(clip).values():
        assert own["dq_sclerp"] == pytest.approx(dict.fromkeys(UPDATES, 1.0), rel=0.01)
    # The mean square of what an arc is off its chord, the 30 cm circle 0.4 times a second round.
    for rate, row in table.even_points(clip).items():
        if rate <= 15:
            sagitta = 0.3 * (1.0 - np.cos(np.pi * 0.4 / rate))
            assert row[1] == pytest.approx(np.sqrt(8.0 / 15.0) * sagitta, rel=0.02)


def test_a_spline_of_a_circle_needs_far_fewer_updates_than_chords():
    own = needed(circling(turns=0.5))[FIRST]
    for name in ("motor_spline", f"motor_spline{table.CHOSEN}"):
        assert set(own[name]) == set(UPDATES)
        assert max(own[name].values()) < 0.6


def test_senders_begin_one_after_the_other_within_an_interval():
    clip = circling(rate=240.0)
    sent = table.senders(clip, 10.0)
    begins = [clip.times[keys[0]] for keys in sent]
    assert len(sent) == table.PHASES
    np.testing.assert_allclose(begins, np.arange(table.PHASES) / (10.0 * table.PHASES))
    assert all(np.all(np.diff(keys) == 24) for keys in sent)


def test_means_are_geometric_and_over_the_clips_that_got_there():
    mean = table.mean_over([{30: 0.25}, {30: 1.0, 12: np.inf}, {30: np.inf}, {}])
    assert mean["updates"][0] == pytest.approx(15.0)
    assert mean["saved"][0] == pytest.approx(0.5)
    assert (mean["reached"].tolist(), mean["asked"].tolist()) == ([2, 0, 0, 0], [3, 0, 0, 1])
    assert np.isnan(mean["saved"][3])


# -- bows --------------------------------------------------------------------------------------------------------------


def test_a_pivot_has_all_of_the_bow_and_the_screw_no_error():
    result = table.bows_of(circling(turns=1.0))
    assert list(result) == list(table.BOW_RATES)
    assert all(share == pytest.approx(1.0, abs=1e-9) and error < 1e-9 for share, error in result.values())


def test_a_circle_that_turns_the_other_way_has_less_than_none_of_it():
    assert all(share < 0.0 and error > 1.0 for share, error in table.bows_of(circling(turns=-1.0)).values())


def test_a_body_that_flies_straight_has_no_error_to_compare():
    assert table.bows_of(spinning_straight()) == {}


@pytest.mark.parametrize("seed", range(8))
def test_the_screw_is_nearer_exactly_where_more_than_half_of_the_bow_is_there(seed: int):
    result = table.bows_of(swinging_clip(seed=seed))
    assert result
    for share, error in result.values():
        assert (share > 0.5) == (error < 1.0)
