"""Tests of compare.py on whole bodies."""

import pytest

from tests.scripts.bvh_bodies import JOINTS, TIMES, write_body
from tests.scripts.comparing import COLUMNS, rows_of, run, write_toss

MODES = ("lerp_slerp", "dq_sclerp")

QUICK = ("--no-video", "--modes", ",".join(MODES))


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    """The metrics of a whole body and a single rigid body."""
    folder = tmp_path_factory.mktemp("bodies")
    walk, toss, output = (
        write_body(folder / "walk.bvh", TIMES[:21]),
        write_toss(folder / "toss.csv", 30),
        folder / "output",
    )
    options = ("--tolerance", "1cm", "--shared", "--rates", "5,10", "--radius", "5cm")
    assert run(walk, toss, *QUICK, *options, "--output", output) == 0
    assert (output / "metrics.csv").read_text().splitlines()[0] == COLUMNS
    return rows_of(output / "metrics.csv")


def test_the_table_has_a_row_for_every_body_choice_and_mode(rows: list[dict[str, str]]) -> None:
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
