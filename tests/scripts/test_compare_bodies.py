"""compare.py on whole bodies: what it writes of them, and what becomes of the others where one cannot be read."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.cli import compare
from rigid_motion_batch.recordings import read_trajectories
from tests.blank import blank
from tests.scripts.comparing import COLUMNS, ROOT, write_toss
from tests.scripts.recordings.skeletons import body, export
from tests.scripts.recordings.test_damaged_bvh_bodies import seed

MODES = ("lerp_slerp", "dq_sclerp")

QUICK = ("--no-video", "--modes", ",".join(MODES))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def write_body(folder: Path, name: str = "walk") -> Path:
    """A BVH of a body with two arms, which swings all of its joints for two seconds."""
    path = folder / f"{name}.bvh"
    path.write_text(seed("ZXY", 60, speed=0.1), encoding="utf-8")
    return path


def joints_in(path: Path) -> tuple[str, ...]:
    return read_trajectories(str(path)).trajectories[0].rest_body.joints


def run(*arguments: object, jobs: int = 0) -> int:
    return compare.main(["--jobs", str(jobs), *map(str, arguments)])


# -- what is written --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A body, and what the command that people type writes of it, beside a single rigid one."""
    folder = tmp_path_factory.mktemp("bodies")
    walk, toss, output = write_body(folder), write_toss(folder / "toss.csv"), folder / "output"
    command = [sys.executable, ROOT / "scripts" / "compare.py", walk, toss, *QUICK, "--jobs", "1", "--output", output]
    command += ["--decimate", "adaptive", "--tolerance", "1cm", "--shared", "--rates", "5,10", "--radius", "5cm"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(output / "report.html")
    return walk, output


def test_the_table_has_a_row_for_every_body_choice_and_mode(written: tuple[Path, Path]) -> None:
    walk, output = written
    joints = joints_in(walk)
    assert (output / "metrics.csv").read_text().splitlines()[0] == COLUMNS
    rows = rows_of(output / "metrics.csv")
    choices = [("5", "uniform", ""), ("10", "uniform", ""), ("", "adaptive", "0.01")]
    for clip in ("walk", "toss"):
        result = [
            (row["rate_hz"], row["decimation"], row["tolerance_m"], row["mode"]) for row in rows if row["clip"] == clip
        ]
        assert result == [(*choice, mode) for choice in choices for mode in MODES]
    for row in rows:
        if row["clip"] == "toss":
            assert {row[name] for name in COLUMNS.split(",")[-5:]} == {""}
            continue
        assert int(row["joints"]) == len(joints)
        assert row["worst_joint"] in joints
        assert int(row["key_frames"]) <= int(row["keys"]) <= len(joints) * int(row["key_frames"])
        assert 0.0 < float(row["rms_shell_m"]) <= float(row["p95_shell_m"]) <= float(row["max_shell_m"]) < 1.0
        if row["decimation"] == "adaptive":
            assert float(row["max_shell_m"]) <= 0.01 * (1.0 + 1e-9)


def test_a_larger_radius_makes_shell_errors_larger_and_nothing_else(written: tuple[Path, Path], tmp_path: Path) -> None:
    walk, output = written
    assert run(walk, *QUICK, "--rates", "5", "--output", tmp_path) == 0
    without = {(row["mode"], row["joint"]): row for row in rows_of(tmp_path / "metrics_joints.csv")}
    for row in rows_of(output / "metrics_joints.csv"):
        if row["rate_hz"] == "5":
            other = without[row["mode"], row["joint"]]
            assert row["rms_position_m"] == other["rms_position_m"]
            assert float(row["rms_shell_m"]) >= float(other["rms_shell_m"]) * (1.0 - 1e-9)


def test_the_joints_of_an_earlier_run_do_not_pass_for_those_of_this(tmp_path: Path) -> None:
    walk, toss, output = write_body(tmp_path), write_toss(tmp_path / "toss.csv"), tmp_path / "output"
    asked = (toss, *QUICK, "--rates", "5", "--output", output)
    assert run(walk, *asked) == 0
    table = (output / "metrics_joints.csv").read_bytes()
    assert run(*asked) == 0
    assert not (output / "metrics_joints.csv").exists()
    assert run(walk, *asked) == 0
    assert (output / "metrics_joints.csv").read_bytes() == table


# -- bodies that cannot be read ---------------------------------------------------------------------------------------


@pytest.fixture
def fbx(empty_file: object, tmp_path: Path) -> Path:
    """A sound one."""
    body()
    return export(tmp_path / "sound.fbx")


def lines_about(said: str, path: Path) -> list[str]:
    assert "Traceback" not in said
    return [line for line in said.splitlines() if str(path) in line]


@pytest.mark.parametrize("jobs", [0, 1])
def test_a_damaged_body_is_told_in_one_line_and_the_others_go_on(fbx, tmp_path, capfd, jobs):
    content, walk, output = fbx.read_bytes(), write_body(tmp_path), tmp_path / "output"
    cut, torn = tmp_path / "cut.fbx", tmp_path / "torn.bvh"
    cut.write_bytes(content[: len(content) // 2])
    torn.write_text(walk.read_text().replace("}", "", 1), encoding="utf-8")
    assert run(cut, walk, torn, fbx, *QUICK, "--rates", "5", "--output", output, jobs=jobs) == 1
    said = capfd.readouterr().err
    for path in (cut, torn):
        (line,) = lines_about(said, path)
        assert "; " in line
    assert {row["clip"] for row in rows_of(output / "metrics.csv")} == {"walk", "sound"}
    blank()
