"""Tests of written files and rows: complete or not there, and safe in spreadsheets."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion_batch.files import append_lines, escaped, line_of, replacing, write_rows, write_text, written_beside


def test_a_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_text(path, "old")

    def write_half() -> None:
        with replacing(path) as stream:
            stream.write("half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("report.html", "old")]


def test_an_error_names_the_file_that_was_asked_for_and_a_folder_of_its_name_stays(tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OSError, match=r"report\.html") as raised:
        write_text(tmp_path / "report.html", "new")
    assert raised.value.filename == str(tmp_path / "report.html")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "real.html").write_text("old")
    (tmp_path / "link.html").symlink_to("real.html")
    write_text(tmp_path / "link.html", "new")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "real.html").read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 2


def test_the_name_beside_is_short_however_long_the_name_is(tmp_path: Path) -> None:
    path = tmp_path / f"{'x' * 247}.blend1"
    with written_beside(path) as beside:
        assert len(beside.name) < 30
        assert beside.suffix == path.suffix
        beside.write_text("whole")
    assert [item.name for item in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("links", [True, False])
def test_what_has_come_meanwhile_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    if not links:
        monkeypatch.setattr("os.link", refuse_links)
    path = tmp_path / "keys.csv"
    with written_beside(path, overwrite=False) as beside:
        beside.write_text("first")
    with pytest.raises(FileExistsError) as raised, written_beside(path, overwrite=False) as beside:
        beside.write_text("second")
    assert raised.value.filename == str(path)
    assert [(item.name, item.read_text()) for item in tmp_path.iterdir()] == [("keys.csv", "first")]


def refuse_links(*_: object) -> None:
    raise PermissionError(1, "Operation not permitted")


def test_folders_that_were_made_for_nothing_are_gone(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(ZeroDivisionError), written_beside(tmp_path / "there" / "new" / "folder" / "keys.csv"):
        raise ZeroDivisionError
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def test_lines_are_appended_as_they_are_on_systems_that_have_ends_of_their_own(tmp_path, monkeypatch):
    opened, binary = [], 1 << 30
    monkeypatch.setattr(os, "O_BINARY", binary, raising=False)
    plain = os.open
    monkeypatch.setattr(
        os, "open", lambda path, flags, mode: opened.append(flags) or plain(path, flags & ~binary, mode)
    )
    append_lines(tmp_path / "lines", [{"a": 1}])
    assert all(flags & binary for flags in opened)
    assert (tmp_path / "lines").read_bytes() == b'\n{"a": 1}\n'


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
