"""Tests of compare --against: another motion of the same clip, in all outputs of a comparison."""

import json
import re
from pathlib import Path

import bpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.analysis.modes import name_of_other
from tests.balls import largest_displacements
from tests.scripts.bvh_bodies import PLACES, angles_at, hips_at, write_body
from tests.scripts.comparing import ROOT, SMALL, poses_of, rows_of, run, shell_errors, table, write_toss

pytestmark = pytest.mark.any_blender

FAST = ("--no-video", "--rates", "10")


@pytest.fixture(scope="module")
def toss(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toss(tmp_path_factory.mktemp("clips") / "toss.csv", 90)


@pytest.fixture(scope="module")
def mine(toss: Path) -> Path:
    """Every fourth pose of the recording without its ends, at other times and slightly displaced."""
    columns = {name: column[5:-7:4] for name, column in table(toss).items()}
    poses, path = poses_of(columns), toss.with_name("mine.csv")
    poses.positions[:, 0] += 0.01 * np.sin(np.arange(len(poses)))
    write_poses(path, columns["t"] + 0.003, poses)
    return path


def by_scipy(mine: Path, times: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Return positions on straight lines between the samples of a table, and rotations by SLERP."""
    own = table(mine)
    turns = Slerp(own["t"], Rotation.from_quat(poses_of(own).quaternions, scalar_first=True))
    return np.stack([np.interp(times, own["t"], own[name]) for name in "xyz"], axis=-1), turns(times)


def test_its_numbers_are_those_of_straight_lines_and_slerp_between_its_samples(toss, mine, tmp_path):
    options = (*FAST, "--tolerance", "1cm", "--modes", "lerp_slerp,motor_spline")
    assert run(toss, "--against", mine, *options, "--output", tmp_path) == 0
    recording, own = table(toss), table(mine)
    rows = {(row["rate_hz"], row["mode"]): row for row in rows_of(tmp_path / "metrics.csv")}
    common = (recording["t"] >= own["t"][0]) & (recording["t"] <= own["t"][-1])
    assert 0 < common.sum() < len(common)
    for rate, folder in (("10", "10"), ("", "tolerance-1cm")):
        row, keys = rows[rate, "mine"], rows[rate, "lerp_slerp"]
        filled = table(tmp_path / "toss" / folder / "mine.csv")
        assert np.isin(filled["t"], recording["t"][common]).all()
        assert len(filled["t"]) == int(row["samples"]) == int(keys["samples"])
        if not rate:
            assert len(filled["t"]) == common.sum()
        positions, turns = by_scipy(mine, filled["t"])
        assert np.abs(poses_of(filled).positions - positions).max() < 1e-12
        at = np.searchsorted(recording["t"], filled["t"])
        truth = poses_of({name: column[at] for name, column in recording.items()})
        recorded = Rotation.from_quat(truth.quaternions, scalar_first=True)
        shell = shell_errors(Poses(positions, turns.as_quat(scalar_first=True)), truth, 0.1)
        assert float(row["rms_shell_m"]) == pytest.approx(np.sqrt(np.mean(shell**2)), rel=1e-9)
        assert float(row["max_shell_m"]) == pytest.approx(shell.max(), rel=1e-9)
        turned = np.degrees((recorded.inv() * turns).magnitude())
        assert float(row["rms_rotation_deg"]) == pytest.approx(np.sqrt(np.mean(turned**2)), rel=1e-6)
        assert (row["keys"], row["keys_per_s"], row["bytes_per_s"]) == ("", "", "")


def test_it_is_in_the_line_of_the_clip_the_table_and_the_page(toss, mine, tmp_path, capsys):
    assert run(toss, "--against", mine, *FAST, "--output", tmp_path, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert any(
        re.search(r"toss: compared from [\d.]+ to [\d.]+ s alone, where mine has", note) for note in said["notes"]
    )
    assert [line["keys_per_s"] for line in said["table"] if line["name"] == "mine"] == [None]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="clip-0">(.*?)</script>', page)
    (choice,) = json.loads(data)["choices"]
    assert choice["motions"][-1]["modes"] == ["mine"]


@pytest.mark.parametrize(
    ("stem", "called"),
    [("mine", "mine"), ("my take (2)", "my_take_2"), ("keys", "keys-2"), ("lerp_slerp.keys", "lerp_slerp_keys")],
)
def test_it_is_called_as_its_file_but_never_as_a_table_that_is_there(stem, called):
    assert name_of_other(stem) == called


def test_a_body_is_compared_joint_by_joint_by_name_and_in_metres(tmp_path):
    times, own = np.arange(61) / 30.0, np.arange(16) / 7.5
    walk = write_body(tmp_path / "walk.bvh")
    mine = write_body(tmp_path / "mine.bvh", own, ("Head", "LeftHand"), unit=100.0)
    output = tmp_path / "output"
    assert run(walk, "--against", mine, *FAST, "--modes", "lerp_slerp", "--output", output, "--radius", "0.05") == 0

    def placed(hips: np.ndarray, turns: dict[str, Rotation]) -> dict[str, tuple[np.ndarray, Rotation]]:
        result = {"Hips": (hips, turns["Hips"])}
        for name in ("LeftHand", "Head"):
            result[name] = hips + turns["Hips"].apply(PLACES[name]), turns["Hips"] * turns[name]
        return result

    truth = placed(
        hips_at(times), {n: Rotation.from_euler("ZXY", a, degrees=True) for n, a in angles_at(times).items()}
    )
    sampled = {n: Slerp(own, Rotation.from_euler("ZXY", a, degrees=True)) for n, a in angles_at(own).items()}
    hips = np.stack([np.interp(times, own, column) for column in hips_at(own).T], axis=-1)
    shown = placed(hips, {name: slerp(times) for name, slerp in sampled.items()})
    shell = {}
    for name in PLACES:
        (there, turned), (here, turns) = truth[name], shown[name]
        shell[name] = largest_displacements(here - there, 0.05 * (turns.as_matrix() - turned.as_matrix()))
    joints = {row["joint"]: row for row in rows_of(output / "metrics_joints.csv") if row["mode"] == "mine"}
    for name, errors in shell.items():
        assert float(joints[name]["rms_shell_m"]) == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)
    (row,) = (row for row in rows_of(output / "metrics.csv") if row["mode"] == "mine")
    assert float(row["max_shell_m"]) == pytest.approx(max(errors.max() for errors in shell.values()), rel=1e-6)
    assert (row["joints"], row["keys"], row["key_frames"]) == ("3", "", "")
    assert not list(output.rglob("mine*.csv"))


def test_a_film_has_a_lane_of_it(toss, mine, tmp_path):
    how = ("--rates", "10", "--modes", "lerp_slerp", "--deviation", "1", "--output", tmp_path)
    assert run(toss, "--against", mine, *how, *SMALL) == 0
    folder = tmp_path / "toss" / "10"
    assert (folder / "comparison.mp4").stat().st_size > 0
    bpy.ops.wm.open_mainfile(filepath=str(folder / "comparison.blend"))
    scene, start = bpy.context.scene, table(folder / "keys.csv")["t"][0]
    assert bpy.data.objects["mine title"].data.body == "mine"
    centre = np.array(scene["recording_centre_m"])
    for frame in (1, 3, scene.frame_end):
        scene.frame_set(frame)
        positions, turns = by_scipy(mine, np.array([start + (frame - 1) / scene.render.fps]))
        actor = bpy.data.objects["mine"]
        assert np.abs(np.array(actor.location) - (positions[0] - centre)).max() < 1e-5
        there = Rotation.from_quat(np.array(actor.rotation_quaternion), scalar_first=True)
        assert (there.inv() * turns[0]).magnitude() < 1e-5


@pytest.mark.parametrize(
    ("other", "complaint"),
    [
        ("nowhere.csv", "nowhere.csv: no such file; check the path"),
        (".", "this is a folder without recordings; name a file"),
        ("broken.csv", "broken.csv:1: "),
        ("late.csv", "late.csv: it lasts from 100.* to .* s, and .*toss.csv from .*; give both the same clock"),
        ("body.bvh", "body.bvh: this is a body of 3 joints, and .*toss.csv a single rigid body; give the same of both"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_a_line(other, complaint, toss, tmp_path, capsys):
    (tmp_path / "broken.csv").write_text("a,b\n1,2\n")
    late = table(toss)
    write_poses(tmp_path / "late.csv", late["t"] - late["t"][0] + 100.0, poses_of(late))
    write_body(tmp_path / "body.bvh")
    assert run(toss, "--against", tmp_path / other, *FAST, "--quiet", "--output", tmp_path / "output") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert re.search(complaint, lines[0]), lines
    assert not (tmp_path / "output" / "metrics.csv").exists()


def test_a_body_without_a_joint_of_the_recording_is_refused(tmp_path, capsys):
    walk = write_body(tmp_path / "walk.bvh")
    less = write_body(tmp_path / "less.bvh", order=("Head",))
    assert run(walk, "--against", less, *FAST, "--output", tmp_path / "output") == 2
    assert f"{less}: it has no joint LeftHand; {walk} has it" in capsys.readouterr().err


def test_it_is_of_one_clip(toss, mine, capsys):
    with pytest.raises(SystemExit) as ended:
        run(toss, ROOT / "assets" / "reach.csv", "--against", mine)
    assert ended.value.code == 2
    assert "--against is a motion of one clip, and there are 2: name one recording" in capsys.readouterr().err
