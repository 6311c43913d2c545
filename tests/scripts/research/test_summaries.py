"""Summaries say what the tables of their page say, also where that is worse than hoped for or only a part."""

from __future__ import annotations

from pathlib import Path

import pytest

from research import markdown_tables, publishing
from research.live_benchmark.turns import beyond
from research.summaries import of_batch, of_live, of_reduction, of_speed, of_sub_frames

RACE = """### A path

| mode | computed by | million poses/s | Rigid Motion is faster by |
|---|---|---:|---:|
| `lerp_slerp` | Rigid Motion | 10.00 |  |
| `dq_sclerp` | Rigid Motion | 8.00 |  |
| `pga_lerp` | Rigid Motion | {blend} |  |
| `motor_spline` | Rigid Motion | 4.00 |  |
| `lerp_slerp` | NumPy, closed form | 20.00 | 0.5 times |
| `dq_sclerp` | pytransform3d | 0.80 | 10.0 times |
"""

CHOOSING = """### A mode for 4 objects, turned by XYZ

| what | Rigid Motion: median (fastest) | beside: median (fastest) | ratio | goal |
|---|---:|---:|---:|---:|
| `set_mode` for all in one call | 2.0 s | `bake_action_objects`: 1.0 s | 2.0 times as long | at most 0.2 s: missed |
| the same, and the view updated | 2.0 s (1.9) | `bake_action_objects`: 7.0 s (6.9) | 3.5 times faster |  |
"""


def said(lines: list[str]) -> str:
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize(("blend", "words"), [("8.00", "25% more"), ("12.50", "20% less")])
def test_more_time_is_never_less_than_none(blend: str, words: str):
    text = said(of_speed(RACE.format(blend=blend)))
    assert f"(`pga_lerp`) take {words} time than `lerp_slerp`" in text
    assert "0.5 times as fast as plain NumPy where it gains least (a path)" in text
    assert "`motor_spline` takes 2.5 times as long as `lerp_slerp`" in text
    assert "10.0 times as fast as pytransform3d" in text
    assert "SciPy" not in text


def test_a_page_in_parts_is_summed_up_by_its_parts():
    assert said(of_live(CHOOSING)) == (
        "- Computing in-betweens, choosing a mode and baking are 3.5 times faster than Blender's own baking, and "
        "slower in 1 case. - Goals met: 0 of 1. Missed: `set_mode` for all in one call (at most 0.2 s)."
    )


@pytest.mark.parametrize("summary", [of_batch, of_live, of_reduction, of_speed, of_sub_frames])
def test_a_page_without_tables_has_no_summary(summary):
    assert summary("# A page\n\nNothing was measured.\n") == []


def test_what_is_published_has_its_summary_below_the_title(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    publishing.publish(["# Title", "", "About it.", "", *CHOOSING.splitlines()], tmp_path / "page.md", of_live)
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert page.startswith("# Title\n\n<!-- summary -->\n\n- Computing in-betweens")
    assert page.index("<!-- end of summary -->") < page.index("About it.")
    assert page in capsys.readouterr().out


def test_tables_are_read_as_they_were_written():
    (race,) = markdown_tables.tables(RACE)
    assert race.section == "A path"
    assert race.row("`dq_sclerp`", "pytransform3d")[2:] == ("0.80", "10.0 times")
    assert race.column("million poses/s")[0] == "10.00"
    for missing in (lambda: race.row("`dq_sclerp`", "SciPy"), lambda: race.column("poses")):
        with pytest.raises(LookupError, match="A path"):
            missing()
    assert markdown_tables.numbers("\N{MINUS SIGN}0.08; 1.00, 6.8e-06") == [-0.08, 1.0, 6.8e-06]


@pytest.mark.parametrize(("ours", "words"), [(0.003, "2.00 ms more"), (0.0005, "0.50 ms less")])
def test_an_edit_takes_more_or_less_and_never_more_below_zero(ours: float, words: str):
    assert beyond([ours], [0.001]) == words


@pytest.mark.parametrize(("ratio", "words"), [(1.077, "7.7% more"), (0.99, "1.0% less"), (1.0, "0.0% more")])
def test_memory_is_more_or_less(ratio: float, words: str):
    assert publishing.more_or_less(ratio) == words
