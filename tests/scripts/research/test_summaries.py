"""Summaries say what the tables of their page say, also where that is worse than hoped for or only a part."""

from __future__ import annotations

import pytest

from research import markdown_tables
from research.summaries import of_paper

RACE = """### A path

| mode | computed by | million poses/s | Rigid Motion is faster by |
|---|---|---:|---:|
| `lerp_slerp` | Rigid Motion | 10.00 |  |
| `dq_sclerp` | Rigid Motion | 8.00 |  |
| `pga_lerp` | Rigid Motion | 8.00 |  |
| `motor_spline` | Rigid Motion | 4.00 |  |
| `lerp_slerp` | NumPy, closed form | 20.00 | 0.5 times |
| `dq_sclerp` | pytransform3d | 0.80 | 10.0 times |
"""


def said(lines: list[str]) -> str:
    return " ".join(" ".join(lines).split())


def test_a_page_without_tables_has_no_summary():
    assert of_paper("# A page\n\nNothing was measured.\n") == []


@pytest.mark.parametrize(
    ("cell", "saved"), [("28.1 (6%)", 6.0), ("30.9 (3% more)", -3.0), ("9.7 (20%; 7 of 8 clips)", 20.0)]
)
def test_what_the_papers_page_saves_is_read_from_its_cells(cell: str, saved: float):
    head = "| | 30/s | 20/s | 15/s | 12/s |\n|---|---:|---:|---:|---:|\n"
    rows = [("*the paper*", "*20 (33%)*"), ("`dq_sclerp`", cell), ("`motor_spline`", "9 (70%)")]
    rows.append(("`motor_spline`, keys where needed", "-"))
    table = head + "\n".join(f"| {name} | " + " | ".join([one] * 4) + " |" for name, one in rows)
    text = said(of_paper(f"# P\n\n**RMS shell error, recordings**\n\n{table}\n"))
    percent = f"{abs(saved):.0f}"
    assert f"here it is {percent}, {percent}, {percent} and {percent} % {'less' if saved > 0.0 else 'more'}" in text
    assert "reach the paper's figures in 0 of 4 rows, the narrowest short by 33 points" in text


def test_tables_are_read_as_they_were_written():
    (race,) = markdown_tables.tables(RACE)
    assert race.section == "A path"
    assert race.row("`dq_sclerp`", "pytransform3d")[2:] == ("0.80", "10.0 times")
    assert race.column("million poses/s")[0] == "10.00"
    for missing in (lambda: race.row("`dq_sclerp`", "SciPy"), lambda: race.column("poses")):
        with pytest.raises(LookupError, match="A path"):
            missing()
    assert markdown_tables.numbers("\N{MINUS SIGN}0.08; 1.00, 6.8e-06") == [-0.08, 1.0, 6.8e-06]
