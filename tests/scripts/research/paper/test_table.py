"""The table on clips of which the answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper import claims, table
from research.paper.table import ADAPTIVE, UNIFORM, Needed, Point
from rigid_motion.motion import MODES
from tests.scripts.research.paper.clips import circling, spinning_straight

FIRST = next(iter(table.YARDSTICKS))


def curve(mode: str, error: float, rates: tuple[float, ...] = (5.0, 10.0, 12.0, 15.0, 20.0, 30.0, 40.0)) -> list[Point]:
    """Errors that fall with the square of the rate."""
    return [Point("made up", mode, UNIFORM, r, r, error / r**2, 2.0 * error / r**2, 3.0 * error / r**2) for r in rates]


def test_a_mode_with_a_quarter_of_the_error_needs_half_the_updates():
    cells = table.needed_by([*curve("lerp_slerp", 1.0), *curve("dq_sclerp", 0.25)])
    found = {(cell.updates, cell.mode, cell.yardstick): cell for cell in cells}
    for row in claims.TABLE:
        for yardstick in table.YARDSTICKS:
            cell = found[row.state_of_the_art, "dq_sclerp", yardstick]
            assert cell.needed == pytest.approx(row.state_of_the_art / 2.0, rel=1e-9)
            assert cell.saved == pytest.approx(0.5, abs=1e-9)
            assert found[row.state_of_the_art, "lerp_slerp", yardstick].needed == pytest.approx(row.state_of_the_art)


def test_a_mode_that_never_gets_there_needs_infinitely_much():
    cells = table.needed_by([*curve("lerp_slerp", 1.0), *curve("dq_sclerp", 100.0)])
    worse = [cell for cell in cells if cell.mode == "dq_sclerp"]
    assert worse
    assert all(cell.needed == np.inf and cell.reached == 0 and cell.asked == 1 for cell in worse)


def test_the_lowest_rate_is_the_first_that_is_good_enough_also_where_a_higher_one_is_not():
    bumpy = [Point("c", "m", UNIFORM, r, r, e, e, e) for r, e in ((5.0, 4.0), (10.0, 1.0), (20.0, 3.0), (30.0, 0.5))]
    assert table.lowest(bumpy, FIRST, 1.0) == 10.0
    assert table.lowest(bumpy, FIRST, 2.0) == pytest.approx(5.0 * 2.0**0.5)
    assert table.lowest(bumpy, FIRST, 0.4) == np.inf


def test_on_a_pivot_a_screw_is_as_good_at_the_lowest_rate_that_is_tried():
    clip = circling("pivot", turns=1.0)
    cells = table.needed_by(table.measure_clip(clip, ("lerp_slerp", "dq_sclerp"), ()))
    screw = [cell.needed for cell in cells if cell.mode == "dq_sclerp"]
    assert len(screw) == len(claims.TABLE) * len(table.YARDSTICKS)
    assert max(screw) == pytest.approx(table.LOWEST, rel=0.02)


def test_on_a_circle_without_turning_the_screw_is_the_straight_line():
    clip = circling(turns=0.0)
    points = table.measure_clip(clip, ("lerp_slerp", "dq_sclerp"), ())
    cells = table.needed_by(points)
    for cell in cells:
        assert cell.needed == pytest.approx(cell.updates, rel=0.01)
    # The mean square of what an arc is off its chord, the 30 cm circle 0.4 times a second round.
    sagitta = [0.3 * (1.0 - np.cos(np.pi * 0.4 / one.asked)) for one in points if one.mode == "lerp_slerp"]
    found = [one.rms_shell_m for one in points if one.mode == "lerp_slerp"]
    some = [place for place, one in enumerate(points[: len(found)]) if one.asked <= 15.0]
    np.testing.assert_allclose(np.array(found)[some], np.sqrt(8.0 / 15.0) * np.array(sagitta)[some], rtol=0.02)


def test_a_spline_of_a_circle_needs_far_fewer_updates_than_chords():
    cells = table.needed_by(table.measure_clip(circling(turns=0.5), ("lerp_slerp", "motor_spline"), ("motor_spline",)))
    saved = {
        (cell.decimation, cell.updates): cell.saved
        for cell in cells
        if cell.mode == "motor_spline" and cell.yardstick == FIRST
    }
    assert all(saved[UNIFORM, row.state_of_the_art] > 0.4 for row in claims.TABLE)
    assert all(saved[ADAPTIVE, row.state_of_the_art] > 0.4 for row in claims.TABLE)


def test_modes_that_are_one_motion_get_the_same_numbers():
    points = table.measure_clip(circling(turns=0.5, rate=60.0), tuple(MODES), ())
    by_mode = {mode: [(p.asked, p.rms_shell_m) for p in points if p.mode == mode] for mode in MODES}
    assert by_mode["dq_sclerp"] == by_mode["pga_slerp"] == by_mode["cga_slerp"]
    assert by_mode["pga_lerp"] == by_mode["cga_lerp"]
    assert by_mode["lerp_slerp"] != by_mode["dq_sclerp"]


def test_a_recording_with_fewer_than_two_samples_to_an_update_tells_nothing_of_that_rate():
    clip = circling(turns=0.5, rate=30.0)
    rates = {cell.updates for cell in table.needed_by(table.measure_clip(clip, ("lerp_slerp", "dq_sclerp"), ()))}
    assert rates == {15, 12}


def test_a_motion_without_errors_has_no_cells():
    assert table.needed_by(table.measure_clip(spinning_straight(), ("lerp_slerp", "dq_sclerp"), ("lerp_slerp",))) == []


def test_senders_begin_one_after_the_other_within_an_interval():
    clip = circling(rate=240.0)
    sent = table.senders(clip, 10.0)
    begins = [clip.times[keys[0]] for keys in sent]
    assert len(sent) == table.PHASES
    np.testing.assert_allclose(begins, np.arange(table.PHASES) / (10.0 * table.PHASES))
    assert all(np.all(np.diff(keys) == 24) for keys in sent)


def test_means_are_geometric_and_over_the_clips_that_got_there():
    cells = [
        Needed(name, 30, "dq_sclerp", UNIFORM, FIRST, needed, 1.0 - needed / 30, int(np.isfinite(needed)), 1)
        for name, needed in (("a", 10.0), ("b", 40.0), ("c", np.inf), ("not asked for", 1.0))
    ]
    (mean,) = table.mean_over(cells, "set", ["a", "b", "c"])
    assert mean.needed == pytest.approx(20.0)
    assert mean.saved == pytest.approx(1.0 / 3.0)
    assert (mean.clips, mean.reached, mean.asked) == ("set", 2, 3)


def test_who_looks_ahead_waits_an_interval_more():
    cells = [Needed("set", 30, mode, UNIFORM, FIRST, 20.0, 1.0 / 3.0, 1, 1) for mode in ("dq_sclerp", "motor_spline")]
    waits = {row.mode: row.waits_s for row in table.look_ahead(cells, "set")}
    assert waits == {"dq_sclerp": pytest.approx(0.05), "motor_spline": pytest.approx(0.10)}
