"""Tests of metrics as rows and tables: what they measure, and that hostile names survive."""

import csv
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import rms, shell_error
from rigid_motion_batch.analysis.choices import Choice, Radii, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import JointMetrics, table_names, write_tables
from rigid_motion_batch.analysis.reconstructions import Ground, Reconstruction, errors_of, reconstruct
from rigid_motion_batch.analysis.results import clip_result, measured
from rigid_motion_batch.files import write_rows
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.scripts.clips.bodies import JOINTS, swinging_body
from tests.scripts.clips.recordings import compare_clip
from tests.scripts.test_files import unescaped

HEADER = (
    "clip,joint,mode,rate_hz,keys,samples,rms_shell_m,p95_shell_m,max_shell_m,worst_s,"
    "rms_position_m,rms_rotation_deg,rms_velocity_m_s,decimation,tolerance_m"
)

HOSTILE = (
    'a,b;"c"',
    "two\nlines",
    "three\r\nlines\rof it",
    "<script>alert(1)</script>",
    "=cmd|' /C calc'!A0",
    " ",
    "",
    "'=1+1\t\u2028\x85\x1c\u200b",
)
"""Names with special characters, one for each joint of the body."""

MODES = ("lerp_slerp", "dq_sclerp", "cga_slerp", "motor_spline")

RADII = np.linspace(0.02, 0.12, len(JOINTS))

CHOICES = [Uniform("5"), Tolerance("2cm")]


def made_of(choice: Choice = CHOICES[0], joints: tuple[str, ...] = JOINTS) -> Reconstruction:
    return reconstruct(swinging_body(joints=joints), choice, MODES, RADII)


def cells_of(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    return [[unescaped(cell) for cell in row] for row in rows]


@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_the_rows_are_statistics_of_all_joints_and_of_each(choice: Choice) -> None:
    made = made_of(choice)
    result = measured(made)
    assert [row.mode for row in result.rows] == list(MODES)
    assert [(row.mode, row.joint) for row in result.joints] == [(mode, joint) for mode in MODES for joint in JOINTS]
    for row in result.rows:
        errors = errors_of(made, row.mode, Ground.of(made))
        own = [joint for joint in result.joints if joint.mode == row.mode]
        for name in ("rms_shell_m", "rms_position_m", "rms_rotation_deg", "rms_velocity_m_s"):
            assert getattr(row, name) == pytest.approx(rms(np.array([getattr(joint, name) for joint in own])))
        assert row.max_shell_m == max(joint.max_shell_m for joint in own) == errors.shell.max()
        assert row.worst_joint == max(own, key=lambda joint: joint.max_shell_m).joint
        assert row.keys == sum(joint.keys for joint in own)
        assert row.joints == len(JOINTS)
        assert (row.rate_hz, row.decimation, row.tolerance_m) == (
            ("5", "uniform", None) if choice is CHOICES[0] else ("", "adaptive", 0.02)
        )
        for number, joint in enumerate(own):
            at = np.argmin(np.abs(made.times - made.times[0] - joint.worst_s))
            assert errors.shell[number, at] == joint.max_shell_m
            assert joint.rms_shell_m <= joint.max_shell_m
            assert joint.p95_shell_m <= joint.max_shell_m


def test_a_joint_that_stays_as_it_is_sends_nothing() -> None:
    (row, *_) = measured(made_of()).rows
    moving = len(JOINTS) - 1
    assert row.keys == 11 * moving + 1
    assert row.keys_per_s == pytest.approx(5.0)
    assert row.bytes_per_s == pytest.approx(5.0 * moving * 56)
    assert row.key_frames == 11


def test_the_columns_are_those_promised_and_read_back_exactly(tmp_path: Path) -> None:
    result = measured(made_of(CHOICES[1], joints=HOSTILE))
    write_rows(tmp_path / "joints.csv", JointMetrics, result.joints)
    assert (tmp_path / "joints.csv").read_text().splitlines()[0] == HEADER
    header, *rows = cells_of(tmp_path / "joints.csv")
    assert {len(row) for row in rows} == {len(header)}
    assert [row[1] for row in rows] == [*HOSTILE] * len(MODES)
    for row, expected in zip(rows, result.joints, strict=True):
        for cell, value in zip(row, astuple(expected), strict=True):
            assert type(value)(cell) == value


@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_keys_are_tables_of_poses_in_parents_space_and_read_back_exactly(tmp_path, choice):
    made = made_of(choice, joints=HOSTILE)
    write_tables(tmp_path, made)
    names = table_names(choice, MODES, body=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    for name in names:
        keys = made.keys[MODES[0] if name == "keys.csv" else name.removesuffix(".keys.csv")]
        header, *rows = cells_of(tmp_path / name)
        assert header == ["joint", "t", "x", "y", "z", "qw", "qx", "qy", "qz"]
        own = [joint for joint, own in zip(HOSTILE, keys, strict=True) for _ in own]
        assert [row[0] for row in rows] == own
        assert [[float(cell) for cell in row[1:]] for row in rows] == [
            [made.clip.times[key], *made.clip.poses.positions[number, key], *made.clip.poses.quaternions[number, key]]
            for number in range(len(HOSTILE))
            for key in keys[number]
        ]


@pytest.mark.parametrize("body", [False, True])
def test_errors_are_those_between_what_is_shown(body: bool) -> None:
    clip = swinging_body() if body else read_source(str(ASSETS / "reach.csv"), "unity")[0][0]
    result = compare_clip(clip, Uniform("7"), ("lerp_slerp", "motor_spline"), Radii())
    truth = clip_result(clip, [result]).truth
    for motion in result.motions:
        there = truth[..., result.first : result.first + motion.errors.shape[1]]
        apart = np.linalg.norm(motion.poses.positions - there.positions, axis=-1)
        np.testing.assert_allclose(motion.errors[1], np.atleast_2d(apart).max(axis=0), atol=1e-6)
        assert motion.errors[0].max() == pytest.approx(motion.metrics[0].max_shell_m)
        if not body:
            np.testing.assert_allclose(motion.errors[0], shell_error(motion.poses, there, 0.1), atol=1e-12)
