"""Tests of the benchmark of modes in Blender, and of the figures that its page reads."""

import pytest

from research import benchmark_live
from tests.scripts.research.keeping import written

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


def test_the_study_writes_what_the_page_reads(tmp_path, empty_file, capsys):
    assert benchmark_live.main(["--rounds", "1", "--scale", "0.01", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_live")
    assert len(result["rows"]) == 8
    assert all(row["ms"] >= row["fastest_ms"] > 0.0 < row["native_fastest_ms"] for row in result["rows"])
    assert all(file["uncompressed_mb"] > file["native_uncompressed_mb"] for file in result["files"])
    assert capsys.readouterr().out.count(", native ") == 12
