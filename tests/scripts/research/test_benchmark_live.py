"""The scenes of the benchmark of live in-betweens are what it says, and its figures what the page reads."""

from research import benchmark_live
from tests.scripts.research.keeping import written


def test_the_study_writes_what_the_page_reads(tmp_path, empty_file):
    assert benchmark_live.main(["--rounds", "1", "--scale", "0.01", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_live")
    assert [shot["rotation"] for shot in result["shots"]] == ["QUATERNION", "XYZ"]
    assert len(result["rigs"]) == 6
    assert all(row["ms"] >= row["fastest_ms"] > 0.0 for row in result["rigs"])
