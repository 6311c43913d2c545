"""What compare.py writes of whole bodies."""

from pathlib import Path

import pytest

from tests.scripts.bvh_bodies import JOINTS, write_body
from tests.scripts.comparing import COLUMNS, rows_of, run, write_toss

MODES = ("lerp_slerp", "dq_sclerp")

QUICK = ("--no-video", "--modes", ",".join(MODES))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A body, and what is written of it, beside a single rigid one."""
    folder = tmp_path_factory.mktemp("bodies")
    walk, toss, output = write_body(folder / "walk.bvh"), write_toss(folder / "toss.csv"), folder / "output"
    options = ("--tolerance", "1cm", "--shared", "--rates", "5,10", "--radius", "5cm")
    assert run(walk, toss, *QUICK, *options, "--output", output) == 0
    return walk, output


def test_the_table_has_a_row_for_every_body_choice_and_mode(written: tuple[Path, Path]) -> None:
    _, output = written

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
        assert int(row["joints"]) == len(JOINTS)
        assert row["worst_joint"] in JOINTS
        assert int(row["key_frames"]) <= int(row["keys"]) <= len(JOINTS) * int(row["key_frames"])
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
    walk, toss, output = write_body(tmp_path / "walk.bvh"), write_toss(tmp_path / "toss.csv"), tmp_path / "output"
    asked = (toss, *QUICK, "--rates", "5", "--output", output)
    assert run(walk, *asked) == 0
    table = (output / "metrics_joints.csv").read_bytes()
    assert run(*asked) == 0
    assert not (output / "metrics_joints.csv").exists()
    assert run(walk, *asked) == 0
    assert (output / "metrics_joints.csv").read_bytes() == table
