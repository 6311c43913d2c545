"""Tests that every study and benchmark exists, measures what it says, and writes the figures that its page reads."""

import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from research import benchmark, live_costs, rivals
from research.glb_playing import animation_bytes, errors_of, opened, size_of
from research.live_streams.engines import ENGINES, PICTURES_PER_S, Way, by_engine, seen, truth_of
from research.pages import FIGURES, ROOT
from research.paper.motions import assets
from rigid_motion.motion import Poses
from rigid_motion_batch.cli.commands import RESEARCH
from rigid_motion_batch.places import ASSETS
from tests.gltf.making import Making, walk
from tests.scripts.bvh_bodies import TIMES, write_body
from tests.scripts.research.keeping import names, written


@pytest.mark.blender
@pytest.mark.parametrize("module", RESEARCH.values())
def test_it_can_be_started(module: str) -> None:
    assert callable(import_module(f"research.{module}").main)


def test_rates_are_those_of_the_fastest_round():
    case = next(benchmark.cases(2000))
    program, peer = benchmark.rates(
        case, {("dq_sclerp", benchmark.PROGRAM): [0.004, 0.005], ("dq_sclerp", "SciPy"): [0.4, 0.3]}
    )
    assert program["millions"] == pytest.approx(case.in_betweens / 0.004 / 1e6)
    assert (program["faster_by"], peer["faster_by"]) == (None, pytest.approx(75.0))


def test_the_benchmark_writes_what_its_page_reads(tmp_path):
    assert benchmark.main(["--count", "1000", "--rounds", "1", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark")
    assert result["cases"][0]["in_betweens"] == 1000


@pytest.mark.blender
@pytest.mark.any_blender
def test_the_benchmark_in_blender_writes_what_its_page_reads(tmp_path, empty_file, capsys):
    from research import benchmark_live

    assert benchmark_live.main(["--rounds", "1", "--scale", "0.01", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_live")
    assert len(result["rows"]) == 8
    assert all(row["ms"] >= row["fastest_ms"] > 0.0 < row["native_fastest_ms"] for row in result["rows"])
    assert all(file["uncompressed_mb"] > file["native_uncompressed_mb"] for file in result["files"])
    assert capsys.readouterr().out.count(", native ") == 12


@pytest.mark.parametrize("engine", ENGINES)
def test_a_steady_hand_is_shown_steadily(engine: str) -> None:
    times = np.arange(900) / 90.0
    hand = Poses(times[:, None] * (0.5, 0.0, 0.0), np.tile((1.0, 0.0, 0.0, 0.0), (900, 1)))
    truth, frames = truth_of(times, hand), np.arange(0.5, 9.9, 1.0 / PICTURES_PER_S)
    result = seen(by_engine(engine, truth, Way(0.02, 0.02, 0.0), frames), truth, frames)
    # At most half an update's motion: an engine without a buffer holds each pose until the next.
    assert result["largest_mm"] < 1e3 * 0.5 / 30.0 + 3.0
    assert (result["freezes"], result["jumps_back"]) == (0, 0)
    assert 0.02 < result["delay"] < 0.3


def test_the_study_of_live_costs_writes_what_its_page_reads(tmp_path, monkeypatch):
    write_body(tmp_path / "walk.bvh", TIMES[:20])
    monkeypatch.setattr(live_costs, "HAND", "pivot")
    monkeypatch.setattr(live_costs, "WAYS", {"20 ms": live_costs.WAYS["20 ms"]})
    figures = ("bytes", "heard", "expected", "rate", "median_ms", "p99_ms", "router", "listeners")
    result = {"users": 3, "seconds": 2.0, **dict.fromkeys(figures, 1.0)}
    monkeypatch.setattr(live_costs.room, "measured", lambda users, seconds: result)
    given = [str(tmp_path / "walk.bvh"), str(ASSETS / "pivot.csv")]
    assert live_costs.main([*given, "--users", "3", "--seconds", "2", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "live_costs")
    assert [row["by"] for row in result["engines"]] == [*ENGINES, "sent when needed"]
    single = result["single"]["rows"][0]["ways"]
    assert result["single"]["median"] == single
    saved = 1.0 - single["when needed, 100 ms"]["bytes"] / single[live_costs.FLOATS]["bytes"]
    assert result["single"]["saved"]["100 ms"] == pytest.approx(saved, abs=1e-5)


def test_a_tool_stays_in_the_hand_and_a_door_on_its_hinge_by_screws_alone():
    slips = rivals.slips(assets().values())
    for levers in slips.values():
        for row in levers.values():
            assert row["bezier"] > 1.0
            assert row["lerp_slerp"] > 1.0
            assert row["dq_sclerp"] == row["motor_spline"] == 0.0
    for degrees, off in ((60.0, 107.18), (120.0, 400.0)):
        door = rivals.door(degrees)
        # The distance from the middle of the chord to the arc.
        assert door["lerp_slerp"] == pytest.approx(off, abs=0.01)
        assert door["dq_sclerp"] == 0.0


def test_the_sign_of_a_quaternion_turns_blenders_curves_the_long_way_alone():
    off = rivals.other_sign(assets().values())
    assert off["bezier"] > 150.0
    assert off["motor_spline"] < 30.0


def test_the_figures_of_the_rivals_are_those_of_the_page(tmp_path: Path):
    assert rivals.main(["--recordings", str(ASSETS), "--root", str(tmp_path)]) == 0
    new, kept = (json.loads((root / FIGURES / "rivals.json").read_text(encoding="utf-8")) for root in (tmp_path, ROOT))
    assert len(new.pop("recordings")) == 6
    assert new.pop("left_out") == ["models"]
    assert names(new) == names({name: kept[name] for name in new})


MOVED = 0.25


def named(made: Making, path: Path, name: str = "Walk") -> Path:
    made.json["animations"][0]["name"] = name
    return made.write(path)


def moved(made: Making, frame: int) -> Making:
    """Return the file with the first joint displaced on one frame."""
    channel = made.json["animations"][0]["channels"][0]
    output = made.json["animations"][0]["samplers"][channel["sampler"]]["output"]
    view = made.json["bufferViews"][made.json["accessors"][output]["bufferView"]]
    values = np.frombuffer(made.buffers[0], "<f4", view["byteLength"] // 4, view["byteOffset"]).reshape(-1, 3)
    values[frame, 1] += MOVED
    return made


@pytest.fixture
def original(tmp_path: Path) -> Path:
    return named(walk(joints=4), tmp_path / "walk.glb")


def test_errors_are_those_of_the_worst_joint_at_eighths_and_at_frames(original: Path, tmp_path: Path) -> None:
    other = named(moved(walk(joints=4), 20), tmp_path / "other.glb")
    errors = errors_of(opened(original, None), opened(other, None), 0.03)
    assert errors == {
        "joints": pytest.approx(MOVED, rel=1e-5),
        "vertices": None,
        "at_frames": pytest.approx(MOVED, rel=1e-5),
    }


def test_nodes_are_found_by_their_names_in_whatever_order(original: Path, tmp_path: Path) -> None:
    made = walk(joints=4)
    nodes = made.json["nodes"]
    nodes.append(nodes.pop(0))
    order = [1, 2, 3, 0]
    for node in nodes:
        node["children"] = [order.index(child) for child in node.get("children", [])]
    made.json["scenes"] = [{"nodes": [3]}]
    for channel in made.json["animations"][0]["channels"]:
        channel["target"]["node"] = order.index(channel["target"]["node"])
    other = opened(named(made, tmp_path / "other.glb"), None)
    assert errors_of(opened(original, None), other, 0.03)["joints"] < 1e-6


def test_a_clip_that_is_left_out_rests(original: Path, tmp_path: Path) -> None:
    other = opened(named(walk(joints=4), tmp_path / "other.glb", "Other"), None)
    assert errors_of(opened(original, None), other, 0.03)["joints"] > 1.0


def test_bytes_and_size_are_those_of_the_file(original: Path) -> None:
    frames = 61
    assert animation_bytes(original) == frames * (4 + 12 + 4 * 16 + 4 * 12)
    assert size_of(opened(original, None)) == pytest.approx(0.9)
