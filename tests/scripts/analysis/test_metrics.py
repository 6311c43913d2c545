from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES, Errors, Poses
from rigid_motion_batch.analysis.choices import Budget, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import (
    measure_reconstruction,
    table_names,
    write_metrics,
    write_poses,
    write_reconstruction,
)
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.recordings import read_trajectories
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.clips.recordings import reconstruct, swinging_clip

COLUMNS = (
    "clip,mode,rate_hz,keys,samples,duration_s,bytes_per_s,"
    "rms_shell_m,p95_shell_m,max_shell_m,rms_position_m,rms_rotation_deg,rms_velocity_m_s,"
    "decimation,tolerance_m,keys_per_s,"
    "joints,key_frames,worst_joint,foot_slide_m,recorded_slide_m"
)


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_the_errors_are_statistics_of_the_samples_between_the_first_and_the_last_key() -> None:
    times = np.array([10.0, 10.1, 10.2, 10.4, 10.5])
    poses = Poses(np.zeros((5, 3)), np.tile((1.0, 0.0, 0.0, 0.0), (5, 1)))
    errors = Errors(
        shell=np.array([0.0, 3.0, 4.0, 0.0]),
        position=np.array([0.0, 1.0, 1.0, 0.0]),
        rotation=np.radians([0.0, 90.0, 90.0, 0.0]),
        velocity=np.array([2.0, 2.0, 2.0]),
    )
    clip = Clip("c", "c.csv", "blender", times, poses, ())
    keys = {"lerp_slerp": np.array([0, 3])}
    reconstruction = Reconstruction(clip, Uniform("5"), keys, {"lerp_slerp": poses[:4]}, {"lerp_slerp": errors})
    (row,) = measure_reconstruction(reconstruction)
    assert (row.keys, row.samples) == (2, 4)
    assert row.duration_s == pytest.approx(0.4)
    assert row.rms_shell_m == pytest.approx(2.5)
    assert row.p95_shell_m == pytest.approx(3.85)
    assert row.max_shell_m == 4.0
    assert row.rms_position_m == pytest.approx(np.sqrt(0.5))
    assert row.rms_rotation_deg == pytest.approx(90.0 * np.sqrt(0.5))
    assert row.rms_velocity_m_s == pytest.approx(2.0)


@pytest.mark.parametrize(("seconds", "bytes_per_s"), [(1.0, 560.0), (3.0, 560.0)])
def test_ten_keys_a_second_are_560_bytes_a_second_however_long_the_clip(seconds: float, bytes_per_s: float) -> None:
    row = measure_reconstruction(reconstruct(swinging_clip(seconds=seconds), "10"))[0]
    assert row.bytes_per_s == pytest.approx(bytes_per_s)


def test_bytes_are_counted_for_the_keys_that_were_there_and_not_for_the_rate_that_was_asked_for() -> None:
    row = measure_reconstruction(reconstruct(swinging_clip(rate=30.0), "120"))[0]
    assert row.bytes_per_s == pytest.approx(30 * 56)


def test_a_single_key_is_refused_with_the_clip_and_the_rate() -> None:
    single = replace(reconstruct(swinging_clip(), "10"), keys=dict.fromkeys(KEYFRAME_MODES, np.array([0])))
    with pytest.raises(ValueError, match="swing at 10 keys/s: 1 key has no in-betweens"):
        measure_reconstruction(single)


def test_metrics_read_back_exactly(tmp_path: Path) -> None:
    rows = measure_reconstruction(reconstruct(swinging_clip(), "10"))
    write_metrics(tmp_path / "metrics.csv", rows)
    for written, row in zip(read(tmp_path / "metrics.csv"), rows, strict=True):
        for name in COLUMNS.split(",")[5:13]:
            assert float(written[name]) == getattr(row, name)
        assert (written["decimation"], written["tolerance_m"]) == ("uniform", "")
        assert float(written["keys_per_s"]) == row.keys_per_s == pytest.approx((row.keys - 1) / row.duration_s)


def test_poses_read_back_exactly(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    times = 1.7e9 + np.sort(random.random(500))
    poses = Poses(
        random.normal(size=(500, 3)) * 10.0 ** random.integers(-12, 5, (500, 1)), random.normal(size=(500, 4))
    )
    write_poses(tmp_path / "keys.csv", times, poses)
    header, *lines = (tmp_path / "keys.csv").read_text().splitlines()
    assert header == "t,x,y,z,qw,qx,qy,qz"
    table = np.array([[float(word) for word in line.split(",")] for line in lines])
    np.testing.assert_array_equal(table, np.column_stack((times, poses.positions, poses.quaternions)))


def test_scales_are_a_last_column_where_poses_have_them(tmp_path: Path) -> None:
    poses = Poses([[1, 2, 3]], [[1, 0, 0, 0]], [2.5])
    write_poses(tmp_path / "keys.csv", np.array([0.5]), poses)
    assert (tmp_path / "keys.csv").read_bytes() == (b"t,x,y,z,qw,qx,qy,qz,s\n0.5,1.0,2.0,3.0,1.0,0.0,0.0,0.0,2.5\n")


def test_a_reconstruction_becomes_its_keys_and_a_table_for_every_mode(tmp_path: Path) -> None:
    reconstruction = reconstruct(swinging_clip(), "10")
    write_reconstruction(tmp_path, reconstruction)
    assert {file.name for file in tmp_path.iterdir()} == {"keys.csv", *(f"{mode}.csv" for mode in KEYFRAME_MODES)}
    keys, filled = read(tmp_path / "keys.csv"), read(tmp_path / "pga_lerp.csv")
    assert [float(row["t"]) for row in keys] == reconstruction.clip.times[reconstruction.keys["pga_lerp"]].tolist()
    assert [float(row["qx"]) for row in filled] == reconstruction.poses["pga_lerp"].quaternions[:, 1].tolist()
    assert [float(row["t"]) for row in filled] == reconstruction.times.tolist()


def test_adaptive_keys_are_told_with_how_they_were_chosen(tmp_path: Path) -> None:
    clip = replace(swinging_clip(), metres_per_unit=0.1)
    made = choose(clip, Tolerance("3mm"), KEYFRAME_MODES, 0.1)
    write_metrics(tmp_path / "metrics.csv", measure_reconstruction(made))
    for row in read(tmp_path / "metrics.csv"):
        assert (row["rate_hz"], row["decimation"], float(row["tolerance_m"])) == ("", "adaptive", 0.003)
        assert int(row["keys"]) == len(made.keys[row["mode"]])
        assert float(row["keys_per_s"]) == pytest.approx((int(row["keys"]) - 1) / 3.0)
        assert float(row["bytes_per_s"]) == pytest.approx(56.0 * float(row["keys_per_s"]))
        assert float(row["max_shell_m"]) <= 0.003 * (1.0 + 1e-9)
    (row, *_) = measure_reconstruction(choose(clip, Budget("7.5"), KEYFRAME_MODES, 0.1))
    assert (row.rate_hz, row.decimation, row.tolerance_m) == ("7.5", "adaptive", None)


def test_a_mode_for_every_segment_costs_a_byte_a_key_and_is_a_column_of_the_keys(tmp_path: Path) -> None:
    made = choose(swinging_clip(), Uniform("10"), ("lerp_slerp", "motor_spline", BEST_OF), 0.1)
    *single, best = measure_reconstruction(made)
    assert best.mode == BEST_OF
    assert [best.bytes_per_s] == pytest.approx([57 / 56 * row.bytes_per_s for row in single[:1]])
    write_reconstruction(tmp_path, made)
    keys, all_keys = read(tmp_path / "best_of.keys.csv"), read(tmp_path / "keys.csv")
    assert [row.pop("mode") for row in keys] == [*made.segment_modes, ""]
    assert keys == all_keys
    filled = {mode: read(tmp_path / f"{mode}.csv") for mode in made.poses}
    ends = [float(row["t"]) for row in keys]
    for first, last, mode in zip(ends[:-1], ends[1:], made.segment_modes, strict=True):
        for own, row in zip(filled[mode], filled[BEST_OF], strict=True):
            if first < float(row["t"]) < last:
                assert [float(word) for word in row.values()] == pytest.approx([float(word) for word in own.values()])


def test_in_the_format_of_tum_poses_are_read_back_as_they_were(tmp_path: Path) -> None:
    made = reconstruct(swinging_clip())
    write_reconstruction(tmp_path, made, "tum")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(table_names(made.choice, made.keys, "tum"))
    for mode in made.keys:
        (read,) = read_trajectories(f"{tmp_path / mode}.tum").trajectories
        assert np.array_equal(read.times, made.times)
        assert np.array_equal(read.poses.positions, made.poses[mode].positions)
        assert np.array_equal(read.poses.quaternions, made.poses[mode].quaternions)
