from __future__ import annotations

from pathlib import Path

import pytest

from scripts.files import replacing, write_text


def test_a_text_is_written_as_utf_8_with_lf_line_ends_and_folders_on_the_way_are_made(tmp_path: Path) -> None:
    write_text(tmp_path / "a" / "b.csv", "grüße\nx\n")
    assert (tmp_path / "a" / "b.csv").read_bytes() == "grüße\nx\n".encode()


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


def test_a_file_is_seen_under_its_name_only_once_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    with replacing(path) as stream:
        stream.write("whole")
        stream.flush()
        assert not path.exists()
    assert path.read_text() == "whole"
