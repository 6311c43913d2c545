from __future__ import annotations

from pathlib import Path

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.needed import OfRigidBody, from_json, keys_needed, to_json, write_keys_needed
from rigid_motion_batch.analysis.reconstructions import joint_groups, reconstruct
from rigid_motion_batch.comparison.results import ClipFacts, Result, read_result, write_result
from tests.scripts.comparison.recordings import swinging_clip


def test_a_result_is_read_back_exactly_with_the_facts_of_its_clip(tmp_path: Path) -> None:
    clip = swinging_clip("übung", seconds=1.0, repairs=("dropped 3 rows",))
    for choice in (Uniform("7.5"), Tolerance("5mm")):
        result = Result.of(reconstruct(clip, choice, (*MODES, BEST_OF), 0.1))
        write_result(tmp_path / "result.json", clip, result)
        (tmp_path / "charts.html").write_text("<svg/>")
        facts, again = read_result(tmp_path / "result.json", tmp_path / "charts.html", tmp_path / "no body.html")
        assert facts == ClipFacts("übung", "übung.csv", "blender", 91, 1.0, ("dropped 3 rows",))
        assert (again.choice, again.rows, again.groups) == (result.choice, result.rows, result.groups)
        assert again.segment_modes == result.segment_modes is not None
        assert again.clip == "übung"
        assert (again.charts(), again.body()) == ("<svg/>", "")


def test_the_charts_are_not_read_until_they_are_wanted(tmp_path: Path) -> None:
    clip = swinging_clip(seconds=0.5)
    write_result(tmp_path / "result.json", clip, Result.of(reconstruct(clip, Uniform("10"), ("lerp_slerp",), 0.1)))
    _, again = read_result(tmp_path / "result.json", tmp_path / "nowhere.html", tmp_path / "nowhere.html")
    assert again.segment_modes is None


def test_modes_are_together_that_are_together_everywhere() -> None:
    assert joint_groups([(("a", "b", "c"), ("d",)), (("a", "c"), ("b",), ("d",))]) == (("a", "c"), ("b",), ("d",))
    assert joint_groups([(("a", "b"), ("c", "d")), (("a", "b"), ("c", "d"))]) == (("a", "b"), ("c", "d"))
    assert joint_groups([]) == ()


def test_the_keys_needed_are_read_back_exactly_also_where_there_are_none(tmp_path: Path) -> None:
    # Of half a second there are no two keys at 5 a second or less, and every sample is one at 30.
    found = [keys_needed(OfRigidBody(swinging_clip(seconds=0.15, rate=30.0), 0.1), ("lerp_slerp", "pga_lerp"))]
    again = [from_json(to_json(one)) for one in found]
    for name, clips in (("a.csv", found), ("b.csv", again)):
        write_keys_needed(tmp_path / name, clips)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert to_json(again[0]) == to_json(found[0])
    assert "NaN" in to_json(found[0])
