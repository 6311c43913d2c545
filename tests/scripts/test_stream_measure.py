"""Tests of `stream measure`: the cost of a recording, and the motion that another process shows."""

import json
from pathlib import Path

import numpy as np
import pytest

from research.live_streams.packings import packed, smallest_three
from rigid_motion_batch.cli.stream import main
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming.sending import body_of, samples_of
from tests.scripts.bvh_bodies import write_body

pytestmark = pytest.mark.network


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_body(tmp_path_factory.mktemp("walk") / "walk.bvh")


def test_a_body(walk: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shown = tmp_path / "shown.bvh"
    options = ["--axes", "blender", "--scale", "1", "--start", "0"]
    assert main(["measure", str(walk), "--json", "--output", str(shown), *options]) == 0
    result = json.loads(capfd.readouterr().out)
    assert result["largest_mm"] <= 5.05
    assert result["share_within_tolerance"] > 0.99
    assert result["bytes_a_second_with_headers"] == pytest.approx(
        result["bytes_a_second"] + 28 * (result["datagrams"] - 1) / result["seconds"]
    )
    # The written file confirms the numbers.
    (before, after) = (read_clips([str(path)])[0][0] for path in (walk, shown))
    true, there = (clip.rest_body.skeleton.in_root_space(clip.poses).positions for clip in (before, after))
    assert true.shape == there.shape
    assert 0.0005 < np.linalg.norm(true - there, axis=-1).max() * before.metres_per_unit < 0.0051


def test_a_single_body_with_loss(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    source, shown = ASSETS / "reach.csv", tmp_path / "shown.csv"
    options = ["--radius", "0.1", "--loss", "0.05", "--json"]
    assert main(["measure", str(source), "--output", str(shown), *options]) == 0
    result = json.loads(capfd.readouterr().out)
    assert result["share_within_20_mm"] > 0.95
    assert len(read_clips([str(shown)])[0][0].times) == len(read_clips([str(source)])[0][0].times)


HOLD = ["measure", f"{ASSETS / 'hold.csv'}:*", "--radius", "10cm"]


def test_a_tool_slips_least_in_the_space_of_the_hand(capfd: pytest.CaptureFixture[str]) -> None:
    assert main([*HOLD, "--held", "hold-tool", "hold-hand", "--loss", "0.05", "--json"]) == 0
    result = json.loads(capfd.readouterr().out)
    apart, in_world, in_hand, alone = (result[way] for way in list(result)[2:])
    assert max(in_hand["slip_mm"], 6.0) < min(apart["slip_mm"], in_world["slip_mm"])
    # The recording itself slips by 2.1 mm.
    assert in_hand["slip_mm"] <= 3.0
    cost = "bytes_a_second_with_headers"
    assert in_hand[cost] < min(in_world[cost], apart[cost])
    # One datagram more or less is ten bytes per second for such a short recording.
    assert in_hand[cost] <= alone[cost] + 20.0


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--held", "axe", "hold-hand"], "axe: no such body; there are hold-hand, hold-tool"),
        (["--held", "hold-tool", "hold-hand:palm"], "hold-hand: palm? It has hold-hand"),
        (["--held", "hold-tool", "hold-tool"], "hold-tool cannot be held by hold-tool"),
        (["--held", "hold-tool", "hold-hand", "--output", "shown.csv"], "--held writes no file"),
        ([], "2 bodies; name one body with FILE:BODY, or two with --held TOOL HAND"),
    ],
)
def test_what_is_not_held_is_one_line(options: list[str], what: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main([*HOLD, *options]) == 2
    said = capfd.readouterr().err
    assert what in said
    assert said.count("\n") == 1


def test_a_body_is_no_table(walk: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", str(walk), "--output", str(tmp_path / "shown.csv")]) == 2
    assert "a body is written as .bvh" in capfd.readouterr().err


def test_packed_joints_are_as_far_off_as_their_bits_say(walk: Path) -> None:
    (clip,) = read_clips([str(walk)])[0]
    times, poses = samples_of(clip)
    own = body_of(clip, poses, 0.03)
    off = {way: cost["largest_mm"] for way, cost in packed(own, times, poses).items()}
    assert off["float32 at 30 Hz"] < 1e-2 < off["29 bits at 30 Hz"] < off["29 bits at 12 Hz"]
    random = np.random.default_rng(1).normal(size=(200, 4))
    random /= np.linalg.norm(random, axis=1)[:, None]
    near = np.abs(np.sum(random * smallest_three(random, 10), axis=1))
    assert np.degrees(2.0 * np.arccos(np.minimum(near, 1.0))).max() < 0.3
