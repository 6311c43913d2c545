"""Tests of compare.py as users run it: its files, its output, its exit codes."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.analysis.modes import COMPARED
from rigid_motion_batch.cli import compare
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from rigid_motion_batch.scenes import film
from tests.scripts.bvh_bodies import JOINTS, TIMES, write_body
from tests.scripts.comparing import (
    COLUMNS,
    ROOT,
    SMALL,
    outputs,
    poses_of,
    rows_of,
    run,
    shell_errors,
    table,
    write_toss,
)

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


@pytest.fixture(scope="module")
def short_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toss(tmp_path_factory.mktemp("clips") / "toss.csv", samples=91)


def recordings_in_assets() -> dict[str, dict[str, np.ndarray]]:
    """Return the columns of each body of each file, by clip name."""
    bodies: dict[str, list[dict[str, str]]] = {}
    for path in (ROOT / "assets").glob("*.csv"):
        for row in rows_of(path):
            device = row.pop("device", "")
            bodies.setdefault(f"{path.stem}-{device}" if device else path.stem, []).append(row)
    return {
        clip: {name: np.array([float(row[name]) for row in rows]) for name in rows[0]} for clip, rows in bodies.items()
    }


def errors_of(filled: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return errors between two tables by SciPy: origin offsets (n, 3), turns in radians (n,) and shell errors (n,)."""
    shown, true = poses_of(filled), poses_of(truth)
    turns = [Rotation.from_quat(poses.quaternions, scalar_first=True) for poses in (shown, true)]
    return {
        "offset": shown.positions - true.positions,
        "turn": (turns[1].inv() * turns[0]).magnitude(),
        "shell": shell_errors(shown, true, 0.1),
    }


def test_every_number_can_be_had_again_from_the_tables_and_the_recording(tmp_path):
    assert run("--no-video", "--output", tmp_path, "--rates", "5,20") == 0
    rows = rows_of(tmp_path / "metrics.csv")
    clips = recordings_in_assets()
    expected = [(clip, rate, mode) for clip in clips for rate in ("5", "20") for mode in COMPARED]
    assert sorted((row["clip"], row["rate_hz"], row["mode"]) for row in rows) == sorted(expected)
    assert (tmp_path / "metrics.csv").read_text().splitlines()[0] == COLUMNS
    for row in rows:
        recording = clips[row["clip"]]
        folder = tmp_path / row["clip"] / row["rate_hz"]
        filled, keys = table(folder / f"{row['mode']}.csv"), table(folder / "keys.csv")
        compared = (recording["t"] >= keys["t"][0]) & (recording["t"] <= keys["t"][-1])
        truth = {name: column[compared] for name, column in recording.items()}
        assert np.array_equal(filled["t"], truth["t"])
        assert np.isin(keys["t"], truth["t"]).all()
        errors = errors_of(filled, truth)
        offset, shell = errors["offset"], errors["shell"]
        drift = np.linalg.norm(np.diff(offset, axis=0), axis=1) / np.diff(truth["t"])
        expected = {
            "keys": len(keys["t"]),
            "samples": compared.sum(),
            "duration_s": np.ptp(keys["t"]),
            "bytes_per_s": 56 * (len(keys["t"]) - 1) / np.ptp(keys["t"]),
            "rms_shell_m": np.sqrt(np.mean(shell**2)),
            "p95_shell_m": np.percentile(shell, 95),
            "max_shell_m": shell.max(),
            "rms_position_m": np.sqrt(np.mean(np.sum(offset**2, axis=1))),
            "rms_rotation_deg": np.degrees(np.sqrt(np.mean(errors["turn"] ** 2))),
            "rms_velocity_m_s": np.sqrt(np.mean(drift**2)),
            "keys_per_s": (len(keys["t"]) - 1) / np.ptp(keys["t"]),
        }
        for name, value in expected.items():
            assert float(row[name]) == pytest.approx(value, rel=1e-6, abs=1e-9), (row["clip"], row["mode"], name)


def test_all_numbers_are_in_the_report_before_the_first_frame_is_rendered(short_clip, tmp_path, capsys, monkeypatch):
    pages = []
    render = film.render_piece

    def render_piece(*arguments: object) -> None:
        pages.append((tmp_path / "report.html").read_text(encoding="utf-8"))
        render(*arguments)

    monkeypatch.setattr(film, "render_piece", render_piece)
    assert run(short_clip, "--output", tmp_path, "--rates", "5,10", *SMALL) == 0
    assert pages
    assert all('src="toss/5/comparison.mp4"' in page and "Smooth Screw" in page for page in pages)
    tables = {f"toss/{rate}/{name}.csv" for rate in (5, 10) for name in ("keys", *COMPARED)}
    shown = {f"toss/5/comparison.{ending}" for ending in ("mp4", "blend")}
    assert set(outputs(tmp_path)) == tables | shown | {"metrics.csv", "report.html"}
    said = capsys.readouterr()
    assert f"films come as they are made: {tmp_path / 'report.html'}" in said.err
    assert said.out.splitlines()[-1] == str((tmp_path / "report.html").resolve())
    assert run(short_clip, "--output", tmp_path, "--rates", "5,10", *SMALL) == 0
    assert "films come" not in capsys.readouterr().err
    assert len(pages) == 1


def test_the_table_has_a_row_for_every_body_choice_and_mode(short_clip, tmp_path):
    body, modes = write_body(tmp_path / "walk.bvh", TIMES[:21]), ("lerp_slerp", "dq_sclerp")
    options = ("--no-video", "--modes", ",".join(modes), "--rates", "5,10", "--tolerance", "1cm", "--shared")
    assert run(body, short_clip, *options, "--output", tmp_path) == 0
    rows = rows_of(tmp_path / "metrics.csv")
    choices = [("5", "uniform", ""), ("10", "uniform", ""), ("", "adaptive", "0.01")]
    assert [(row["clip"], row["rate_hz"], row["decimation"], row["tolerance_m"], row["mode"]) for row in rows] == [
        (clip, *choice, mode) for clip in ("walk", "toss") for choice in choices for mode in modes
    ]
    for row in rows[:6]:
        assert row["worst_joint"] in JOINTS
        assert len(JOINTS) * int(row["key_frames"]) == int(row["keys"]), "as --shared asks for"
        assert float(row["max_shell_m"]) <= 0.01 * (1.0 + 1e-9) or row["decimation"] == "uniform"
    assert {row[name] for row in rows[6:] for name in COLUMNS.split(",")[-5:]} == {""}


@pytest.mark.parametrize(
    ("asked", "names", "distinct"),
    [
        ((), tuple(COMPARED), True),
        (("--modes", "all"), tuple(COMPARED), False),
        (("--modes", "dq_sclerp,pga_slerp"), ("dq_sclerp", "pga_slerp"), False),
    ],
)
def test_modes_that_are_one_motion_share_a_lane_unless_they_are_asked_for(asked, names, distinct):
    options = compare.parse(["take.csv", *asked])
    assert (options.modes, options.stage.distinct) == (names, distinct)


def test_an_object_that_is_not_there_is_said_before_any_work(short_clip, tmp_path, capsys):
    assert run(short_clip, "--output", tmp_path / "out", "--object", "nowhere.blend:Cube") == 2
    assert "nowhere.blend" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_clip_too_short_for_a_rate_is_left_out_and_for_every_rate_refused(short_clip, tmp_path, capsys):
    assert run(short_clip, "--no-video", "--output", tmp_path, "--rates", "0.5,10") == 0
    assert "toss: too short for two keys at 0.5 a second" in capsys.readouterr().err
    assert not (tmp_path / "toss" / "0.5").exists()
    assert run(short_clip, "--no-video", "--output", tmp_path / "out", "--rates", "0.5") == 2
    assert "give higher --rates" in capsys.readouterr().err
    assert not (tmp_path / "out" / "report.html").exists()


def rendering(output: Path) -> bool:
    """Return whether a piece of a film is being rendered."""
    return any(name.endswith(".mkv") for _, _, names in os.walk(output / OWN_FOLDER / "scratch") for name in names)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for another process")
def test_ctrl_c_while_rendering_leaves_a_report_and_no_half_video(tmp_path):
    clip, options = ROOT / "assets" / "throw.csv", ("--rates", "5", "--modes", "lerp_slerp", "--fps", "60")
    command = [sys.executable, ROOT / "scripts" / "compare.py", clip, *options, "--output", tmp_path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            waited = time.monotonic() + 120
            while not rendering(tmp_path) and time.monotonic() < waited:
                assert process.poll() is None, process.stderr.read()
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            printed, _ = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130
    assert Path(printed.splitlines()[-1]).is_file()
    assert not list(tmp_path.rglob("*.mp4"))


def test_workers_write_what_one_process_writes_to_the_byte(short_clip, tmp_path, capfd):
    adaptive = ("--no-video", "--tolerance", "5mm, 0.02", "--rates", "10", "--modes", "lerp_slerp,motor_spline")
    assert run(short_clip, *adaptive, "--output", tmp_path / "one") == 0
    assert compare.main([str(short_clip), *adaptive, "--output", str(tmp_path / "two"), "--jobs", "2"]) == 0
    assert outputs(tmp_path / "two") == outputs(tmp_path / "one")
    assert capfd.readouterr().out.splitlines()[-1] == str(tmp_path / "two" / "report.html")


def test_one_bad_recording_is_said_and_the_others_go_on(short_clip, tmp_path, capsys):
    bad = tmp_path / "bad.csv"
    bad.write_text("t,x,y,z\n1,2,3,4\n")
    asked = ("--no-video", "--output", tmp_path / "out", "--rates", "10", "--json")
    assert run(bad, short_clip, tmp_path / "nowhere.csv", *asked) == 1
    said = capsys.readouterr()
    complaints = [line.split(": ")[1] for line in said.err.splitlines() if line.startswith("compare.py:")]
    assert complaints == [f"{bad}:1", str(tmp_path / "nowhere.csv"), "2 failed, as said above"]
    result = json.loads(said.out)
    assert result["tasks"] == {"done": 4, "failed": 2}
    assert result["report"] == str(tmp_path / "out" / "report.html")
    assert [*result["failures"]] == [f"read {bad}", f"read {tmp_path / 'nowhere.csv'}"]
    assert result["exit_code"] == 1
    assert {row["clip"] for row in rows_of(tmp_path / "out" / "metrics.csv")} == {"toss"}


def test_the_terminal_ends_with_a_table_a_sentence_and_the_path_which_may_be_opened(
    short_clip, tmp_path, capsys, monkeypatch
):
    asked, opened = (short_clip, "--no-video", "--output", tmp_path, "--rates", "5,10"), []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert run(*asked) == 0
    assert opened == []
    *table, sentence, path = capsys.readouterr().out.splitlines()
    assert path == str(tmp_path / "report.html")
    assert sentence.endswith(".")
    assert "keys" in sentence
    assert max(map(len, table)) <= 100
    errors = {(row["rate_hz"], row["mode"]): row for row in rows_of(tmp_path / "metrics.csv")}
    (smooth,) = [line.split() for line in table if "Smooth Screw" in line and "10 keys/s" not in line][1:]
    assert float(smooth[2]) == pytest.approx(1e3 * float(errors["10", "motor_spline"]["rms_shell_m"]), rel=5e-3)
    assert float(smooth[3]) == pytest.approx(1e3 * float(errors["10", "motor_spline"]["max_shell_m"]), rel=5e-3)
    assert run(*asked, "--open") == 0
    assert opened == [Path(path).as_uri()]


def test_without_blender_films_are_refused_and_numbers_are_not(short_clip, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(compare, "find_spec", lambda name: None if name == "bpy" else find_spec(name))
    monkeypatch.setattr(compare, "blender_program", lambda: "")
    assert run(short_clip, "--output", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert "Videos are made by Blender, which is not here" in said
    assert "--no-video" in said
    assert not (tmp_path / "out").exists()
    assert run("walk.fbx:Hand", "--no-video", "--output", tmp_path / "out") == 2
    assert "walk.fbx:Hand is read by Blender" in capsys.readouterr().err
    assert run(short_clip, "--no-video", "--rates", "5", "--output", tmp_path / "out") == 0


def test_an_output_folder_that_cannot_be_made_is_said(short_clip, tmp_path, capsys):
    (tmp_path / "file").touch()
    assert run(short_clip, "--no-video", "--output", tmp_path / "file" / "out") == 2
    assert f"compare.py: {tmp_path / 'file'}" in capsys.readouterr().err


def test_an_object_that_the_viewer_cannot_have_leaves_the_report(tmp_path, capsys):
    toss = write_toss(tmp_path / "toss.csv")
    how = ("--no-video", "--rates", "10", "--object", tmp_path / "none.blend:Box", "--output", tmp_path / "output")
    assert run(toss, *how) == 1
    assert "the report shows a drill: " in capsys.readouterr().err
    assert (tmp_path / "output" / "report.html").exists()
