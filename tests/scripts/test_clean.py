"""Tests of the command clean: recordings lose their jitter, keep their format, and stay within the tolerance."""

from __future__ import annotations

import contextlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses, shell_error, standing
from rigid_motion.motion.contacts import slide_ratios
from rigid_motion_batch.cli import clean, reduce
from rigid_motion_batch.recordings import ReadingOptions, read_clips, read_trajectories
from tests.motion.test_cleaning import hand, rms, shaken
from tests.scripts.bvh_bodies import write_body
from tests.scripts.recordings.test_layouts import EVERY

TIMES, TRUTH = hand(3, 300)
WALKING = """HIERARCHY
ROOT Hips { OFFSET 0 0 0 CHANNELS 3 Xposition Yposition Zposition
JOINT Thigh { OFFSET 0 0 0 CHANNELS 3 Zrotation Xrotation Yrotation
JOINT Foot { OFFSET 0 -80 0 CHANNELS 0 End Site { OFFSET 0 -5 0 } } } }"""
SPIKES = [80, 81, 200]


@pytest.fixture
def shaky(tmp_path) -> Path:
    """A recording in millimetres with a comment column, spikes, and w last in its quaternions."""
    poses = shaken(TRUTH, 3)
    positions = poses.positions.copy()
    positions[SPIKES] += (0.1, 0.0, 0.05)
    rows = np.column_stack([1000.0 * TIMES, 1000.0 * positions, np.roll(poses.quaternions, -1, axis=1)])
    lines = [",".join(["note", *map("{:.7f}".format, row)]) for row in rows]
    path = tmp_path / "hand.csv"
    path.write_text("\n".join(["# mine", "remark,t [ms],x [mm],y [mm],z [mm],qx,qy,qz,qw", *lines, ""]))
    return path


def run(*arguments: object) -> int:
    return clean.main([*map(str, arguments), "--jobs", "0"])


def poses_of(path: Path) -> Poses:
    (clip,), _ = read_clips([str(path)])
    return clip.in_metres(clip.poses)


def poses_in_world(path: Path) -> Poses:
    (clip,), _ = read_clips([str(path)])
    return clip.in_metres(clip.whole_body.skeleton.in_root_space(clip.poses))


def test_a_table_comes_back_in_its_columns_and_nearer_to_the_truth(shaky, tmp_path, capsys):
    before = shaky.read_text().splitlines()
    assert run(shaky, "--tolerance", "4mm") == 0
    made = tmp_path / "hand-cleaned.csv"
    done = capsys.readouterr()
    assert done.out.splitlines() == [str(made)]
    said = next(line for line in done.err.splitlines() if "jitters" in line)
    assert "jitters by 0.99 mm and 0.28 degrees; moved at most " in said
    assert "; 3 rows were spikes: 80, 81, 200" in said
    after = made.read_text().splitlines()
    assert after[:2] == before[:2]
    assert all(line.startswith(own[:12]) for line, own in zip(after[2:], before[2:], strict=True))
    others = np.delete(np.arange(300), SPIKES)
    assert shell_error(poses_of(made), poses_of(shaky))[others].max() <= 0.004 + 1e-8
    assert rms(poses_of(made), TRUTH) < 0.6 * rms(shaken(TRUTH, 3), TRUTH)


def test_what_was_cleaned_is_left_alone_and_what_is_done_is_not_done_again(shaky, tmp_path, capsys):
    assert run(tmp_path, "--output", tmp_path / "out") == 0
    made = tmp_path / "out" / "hand-cleaned.csv"
    text = made.read_bytes()
    assert run(tmp_path, "--output", tmp_path / "out") == 0
    assert "1 file already cleaned" in capsys.readouterr().err
    assert run(made) == 0
    assert "this was cleaned before" in capsys.readouterr().err
    assert made.read_bytes() == text
    made.write_text("mine")
    assert run(shaky, "--output", tmp_path / "out") == 1
    assert made.read_text() == "mine"
    assert run(shaky, "--output", tmp_path / "out", "--overwrite") == 0


def test_a_body_comes_back_with_its_hierarchy_and_is_bounded_in_the_world(tmp_path, capsys):
    times = np.arange(300) / 60.0
    source = write_body(tmp_path / "body.bvh", times)
    head, rate, rows = re.split("(Frame Time: .*\n)", source.read_text())
    numbers = np.loadtxt(rows.splitlines())
    numbers += np.random.default_rng(5).normal(size=numbers.shape) * ([0.001] * 3 + [0.3] * (numbers.shape[1] - 3))
    source.write_text("".join([head, rate, *(" ".join(map(str, row)) + "\n" for row in numbers)]))
    assert run(source, "--tolerance", "1cm", "--output", tmp_path / "made.bvh") == 0
    said = capsys.readouterr().err
    assert "at its worst joint" in said
    assert "no foot clearly stands: none is held" in said
    assert (tmp_path / "made.bvh").read_text().startswith(head)
    off = shell_error(poses_in_world(source), poses_in_world(tmp_path / "made.bvh"), 0.03)
    assert 0.001 < off.max() <= 0.01 + 1e-6


def test_feet_that_stand_are_held_and_it_says_how_often_they_do(tmp_path, capsys):
    random, steps = np.random.default_rng(2), np.arange(300) / 60.0
    # A hip jitters above a foot that stands, as with inverse kinematics, and then steps.
    hip = 20.0 * steps + 0.2 * random.normal(size=300)
    foot = 20.0 * (np.floor(steps) + np.clip(5.0 * np.mod(steps, 1.0) - 4.0, 0.0, 1.0)) + 10.0
    lean = np.degrees(np.arcsin((foot - hip) / 80.0))
    rows = "\n".join(f"{x} 90 0 {turn} 0 0" for x, turn in zip(hip, lean, strict=True))
    source, made = tmp_path / "walk.bvh", tmp_path / "walk-cleaned.bvh"
    source.write_text(f"{WALKING}\nMOTION\nFrames: 300\nFrame Time: 0.0166667\n{rows}\n")
    assert run(source) == 0
    assert "; contacts held: 5, feet slide by 16 mm there, before by 16 mm" in capsys.readouterr().err
    after, before = (poses_in_world(path).positions for path in (made, source))
    stands = standing(np.arange(300) / 60.0, before[..., [0, 2, 1]], shaky=True)
    assert (after != before).any()
    assert 0.9 < slide_ratios(after, before, stands).max() <= 1.0 + 1e-5


def test_a_pixel_is_as_large_as_the_nearest_thing_has_it(shaky, tmp_path):
    assert run(shaky, "--pixels", "2", "--nearest", "2m", "--focal", "2000", "--output", tmp_path / "a.csv") == 0
    assert run(shaky, "--tolerance", "2mm", "--radius", "2m", "--output", tmp_path / "b.csv") == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_a_clock_that_jitters_is_written_in_steady_steps(tmp_path, capsys):
    jitter = np.random.default_rng(4).normal(size=300) * 0.001
    poses = shaken(TRUTH, 4)
    rows = np.column_stack([TIMES + jitter, poses.positions, poses.quaternions])
    np.savetxt(tmp_path / "hand.csv", rows, delimiter=",", header="t,x,y,z,qw,qx,qy,qz", comments="")
    assert run(tmp_path / "hand.csv") == 0
    assert "clock jitters" in capsys.readouterr().err
    (read,) = read_trajectories(str(tmp_path / "hand-cleaned.csv")).trajectories
    assert np.abs(np.diff(read.times, 2)).max() < 1e-8


def listed() -> str:
    """Return poses as lists without names, which jitter."""
    content = json.loads(EVERY["Record3D"].text)
    content["poses"] = (np.array(content["poses"]) + np.random.default_rng(1).normal(size=(24, 7)) * 1e-3).tolist()
    return json.dumps(content)


@pytest.mark.parametrize(
    ("name", "text", "table", "told"),
    [
        ("lists.json", listed(), "x.csv", "written so that it reads as it was meant"),
        ("turns.csv", EVERY["rows of positions and of rotations in turn"].text, "x.tum", "written as it was read"),
    ],
)
def test_what_cannot_be_written_as_it_was_read_is_refused_and_becomes_a_table(
    tmp_path, capsys, name: str, text: str, table: str, told: str
):
    path = tmp_path / name
    path.write_text(text)
    assert run(path, "--output", tmp_path / f"x{path.suffix}") == 1
    assert f"this cannot be {told}: name a table, --output {table}, or" in capsys.readouterr().err
    assert run(path, "--output", tmp_path / table) == 0
    assert shell_error(poses_of(tmp_path / table), poses_of(path)).max() < 0.01


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("walk.fbx",), "use Clean Motion"),
        (("hand.csv", "--pixels", "1"), "--nearest 2m"),
        (("hand.csv", "--nearest", "1m"), "add --pixels"),
        (("hand.csv", "--pixels", "1", "--nearest", "1m", "--radius", "1m"), "is a tolerance itself"),
        (("hand.csv", "--tolerance", "0"), "is not a tolerance"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, monkeypatch, capsys, arguments, problem):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.fbx").write_bytes(b"")
    code = 2
    with contextlib.suppress(SystemExit):
        code = run(*arguments)
    assert code == 2
    assert problem in capsys.readouterr().err


def test_keys_are_few_of_what_was_cleaned_and_both_promises_are_said(shaky, tmp_path, capsys):
    keys = []
    for given in ((), ("--clean=4mm",)):
        made = tmp_path / f"{len(given)}"
        assert reduce.main([str(shaky), "--tolerance", "3mm", "--output", str(made), "--jobs", "0", *given]) == 0
        keys.append(len((made / "hand-keys.csv").read_text().splitlines()) - 1)
    assert keys[1] < 0.5 * keys[0]
    said = capsys.readouterr().err
    assert "cleaned first: jitters by 0.99 mm" in said
    assert "keys and errors are relative to the cleaned motion" in said
    (clip,), _ = read_clips([str(shaky)], None, ReadingOptions(clean=0.004))
    assert rms(clip.in_metres(clip.poses), TRUTH) < 0.6 * rms(shaken(TRUTH, 3), TRUTH)


def test_all_bodies_of_a_table_are_cleaned(tmp_path, capsys):
    layout = EVERY["PlotJuggler"]
    path = tmp_path / layout.name
    path.write_text(str(layout.text))
    assert run(path) == 0
    said = capsys.readouterr().err
    assert all(f"{body}: " in said for body in layout.bodies)
