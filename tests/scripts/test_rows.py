from __future__ import annotations

import csv
from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from rigid_motion_batch.files import escaped, line_of, write_rows


@dataclass
class Row:
    name: str
    value: float
    count: int


def unescaped(cell: str) -> str:
    return cell[1:] if cell.startswith("'") and escaped(cell) != cell else cell


@given(st.text(max_size=6, alphabet="'=+-@\t\rab 1"))
def test_what_was_meant_comes_back(text):
    assert unescaped(escaped(text)) == text
    assert not escaped(text).startswith(("=", "+", "-", "@", "\t", "\r"))


def test_numbers_stay_numbers_and_rows_come_back(tmp_path):
    rows = [Row("=1+1", -2.5, -3), Row("'plain'", 1e-300, 0), Row('a,"b"\r\nc', 0.1, 7)]
    write_rows(tmp_path / "rows.csv", Row, rows)
    with (tmp_path / "rows.csv").open(encoding="utf-8", newline="") as stream:
        header, *lines = csv.reader(stream)
    assert header == ["name", "value", "count"]
    assert [Row(unescaped(name), float(value), int(count)) for name, value, count in lines] == rows
    assert lines[0] == ["'=1+1", "-2.5", "-3"]
    assert line_of(["-a", -1.0]) == "'-a,-1.0\n"
