"""Tests of what column names of a CSV log mean."""

import re
from pathlib import Path

import pytest

from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.column_names import ColumnName, column_name
from rigid_motion_batch.recordings.columns import layout_of
from rigid_motion_batch.recordings.tables import HeaderLine


@pytest.mark.parametrize(
    ("names", "meant"),
    [
        ("left_foot_pos_x", ColumnName("position", "x", "", "left_foot")),
        ("r_hand_qw", ColumnName("quaternion", "w", "", "r_hand")),
        ("tracker 1 q_w;tracker 1 quat_w", ColumnName("quaternion", "w", "", "tracker 1")),
        ("s;Scale", ColumnName("scale")),
        ("left_scale", ColumnName("scale", body="left")),
        ("q0;q[0];quat_0", ColumnName("quaternion", "0")),
        ("left_q[3];leftQuat3", ColumnName("quaternion", "3", "", "left")),
        ("position[2];pos2;t_2", ColumnName("position", "2")),
        ("m03;M_03;transform_matrix[0][3];pose_0_3", ColumnName("matrix", "03")),
        ("R_11;r11", ColumnName("rotation", "11")),
        ("p_RS_R_x [m]", ColumnName("position", "x", "m", "RS_R")),
        ("q_wo_w;q_wo_w [1];q_wo_w[]", ColumnName("quaternion", "w", "", "wo")),
        ("x_1;pos_x_1", ColumnName("position", "x", "", "1")),
        ("frame;Frame;frameNumber;frame_id;Frame No.;sample index;samples", ColumnName("frame")),
        (";();[;\u00b5;m;deg;w;pos_w;hand_1;max;index;hp;button;position;session_id", None),
        (f"frames_left;frameTime;delta_time;dt;date;{'x' * 101}", None),
    ],
)
def test_bodies_scales_and_frames_are_known_and_what_says_nothing_is_not_guessed_at(names, meant):
    for name in names.split(";"):
        assert column_name(name) == meant, name


PAGE = (Path(__file__).parents[3] / "docs" / "csv.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("row", "kinds"),
    [
        ("time", {"time"}),
        ("position", {"position"}),
        ("quaternion", {"quaternion", "rotation"}),
        ("Euler angles", {"euler", "rotation"}),
        ("scale", {"scale"}),
        ("whose row it is", {"device"}),
    ],
)
def test_the_names_on_the_page_are_known(row: str, kinds: set[str]) -> None:
    (line,) = (line for line in PAGE.splitlines() if line.startswith(f"| {row} |"))
    names = [name for name in re.findall("`(.+?)`", line) if name not in ("w", "--euler")]
    assert len(names) > 1
    for name in names:
        assert column_name(name).kind in kinds, name


def test_the_logger_on_the_page_writes_what_is_read_without_options() -> None:
    (header,) = re.findall(r'log\.WriteLine\("(.+)"\)', PAGE)
    assert list(layout_of(HeaderLine(Path("take.csv"), 1, ",", header.split(",")), ReadingOptions()).bodies) == [""]
    assert len(re.findall(r"\{\d:R\}", PAGE)) == len(header.split(","))
