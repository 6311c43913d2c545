import csv
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import (
    table_names,
    write_poses,
    write_tables,
)
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.recordings import read_trajectories
from tests.scripts.clips.recordings import reconstruct, swinging_clip


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_bytes_are_counted_for_the_keys_that_were_there_and_not_for_the_rate_that_was_asked_for() -> None:
    row = measured(reconstruct(swinging_clip(rate=30.0), "120")).rows[0]
    assert row.bytes_per_s == pytest.approx(30 * 56)


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


def test_a_mode_for_every_segment_costs_a_byte_a_key_and_is_a_column_of_the_keys(tmp_path: Path) -> None:
    made = choose(swinging_clip(), Uniform("10"), ("lerp_slerp", "motor_spline", BEST_OF), 0.1)
    *single, best = measured(made).rows
    assert best.mode == BEST_OF
    assert [best.bytes_per_s] == pytest.approx([57 / 56 * row.bytes_per_s for row in single[:1]])
    write_tables(tmp_path, made)
    keys, all_keys = read(tmp_path / "best_of.keys.csv"), read(tmp_path / "keys.csv")
    assert [row.pop("mode") for row in keys] == [*made.segment_modes, ""]
    assert keys == all_keys
    filled = {mode: read(tmp_path / f"{mode}.csv") for mode in made.keys}
    ends = [float(row["t"]) for row in keys]
    for first, last, mode in zip(ends[:-1], ends[1:], made.segment_modes, strict=True):
        for own, row in zip(filled[mode], filled[BEST_OF], strict=True):
            if first < float(row["t"]) < last:
                assert [float(word) for word in row.values()] == pytest.approx([float(word) for word in own.values()])


def test_in_the_format_of_tum_poses_are_read_back_as_they_were(tmp_path: Path) -> None:
    made = reconstruct(swinging_clip())
    write_tables(tmp_path, made, "tum")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(table_names(made.choice, made.keys, "tum"))
    for mode in made.keys:
        (read,) = read_trajectories(f"{tmp_path / mode}.tum").trajectories
        assert np.array_equal(read.times, made.times)
        assert np.array_equal(read.poses.positions, made.filled_in(mode, made.times).positions)
        assert np.array_equal(read.poses.quaternions, made.filled_in(mode, made.times).quaternions)
