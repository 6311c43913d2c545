"""Logs as other programs write them, which were refused or read wrongly once: read, or named with the way in.

Nearly all hold one motion, that of q0123.csv, by other clocks, in other units and orders.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import read_clips

LOGS = Path(__file__).with_name("logs_of_others")
MOTION = np.loadtxt(LOGS / "q0123.csv", delimiter=",", skiprows=1)
"""t, x, y, z and w, x, y, z."""

FAST = [0.001 * row for row in range(40)]
SLOW = [0.05 * row for row in range(40)]

READ = {
    "adt.csv": ("5691 wo", [0.033333333 * row for row in range(40)], {}, ""),
    "aria_no_utc.csv": ("device", FAST, {}, "times are those of 'tracking_timestamp_us' and not of 'utc_timestamp_ns'"),
    "aria_two_clocks.csv": ("device", FAST, {}, "of 40 rows the time changes in 39, and not in 3"),
    "bagpy.csv": ("bagpy", SLOW, {}, "times are those of 'Time' and not of 'header.stamp.secs and header.stamp.nsecs'"),
    "device_typo.csv": ("head", SLOW, {}, "'lcontroller' is left out, as it has no column y"),
    "ego_pose.json": ("ego_pose", SLOW[:5], {}, "times are taken for microseconds, 20 samples a second"),
    "kitti.txt": ("kitti", [0.1 * row for row in range(40)], {"frame_rate": 10.0}, ""),
    "motive_bones.csv": ("S:Hip", SLOW, {}, ""),
    "motive_semicolon.csv": ("Tool", SLOW, {}, ""),
    "one_us.csv": ("one_us", None, {}, ""),
    "openvins.txt": ("openvins", SLOW, {}, "'q4' is taken for w"),
    "px4.csv": (
        "px4",
        SLOW,
        {},
        "'q[0]' is taken for w; times are those of 'timestamp' and not of 'timestamp_sample'; ti",
    ),
    "q0123.csv": ("q0123", SLOW, {}, "'q0' is taken for w"),
    "rostopic.csv": ("rostopic", SLOW, {}, "times are those of '%time' and not of 'field.header.stamp'"),
    "t_suffix.csv": ("tool", SLOW, {}, ""),
    "transforms.json": ("transforms", [0.1 * row for row in range(5)], {"frame_rate": 10.0}, ""),
    "vicon_quat.csv": ("Tool:Tool", SLOW, {}, ""),
}
"""What the body is called, its times from the first, what has to be said, and what the note says."""


@pytest.mark.parametrize("name", READ)
def test_the_motion_is_read(name: str) -> None:
    body, times, options, note = READ[name]
    recording = read_trajectories(f"{LOGS / name}:*", ReadingOptions(**options))
    (one,) = recording.trajectories
    assert one.name == body
    if times is not None:
        np.testing.assert_allclose(one.times - one.times[0], times, atol=3e-7)
    motion = MOTION[: len(one.times)]
    scale = 0.3 if name == "one_us.csv" else 1.0
    np.testing.assert_allclose(one.poses.positions * one.metres_per_unit, scale * motion[:, 1:4], atol=2e-5)
    turns = Rotation.from_quat(one.poses.quaternions, scalar_first=True)
    assert (turns.inv() * Rotation.from_quat(motion[:, 4:], scalar_first=True)).magnitude().max() < 1e-4
    assert note in recording.note
    assert bool(recording.note) == bool(note)


def test_the_euler_angles_of_vicon_are_read_once_their_order_is_said() -> None:
    (one,) = read_trajectories(str(LOGS / "vicon_segments.csv"), ReadingOptions(euler="XYZ")).trajectories
    assert one.metres_per_unit == 0.001
    turns = Rotation.from_quat(one.poses.quaternions, scalar_first=True)
    angles = np.loadtxt(LOGS / "vicon_segments.csv", delimiter=",", skiprows=5)[:, 2:5]
    assert (turns.inv() * Rotation.from_euler("XYZ", angles, degrees=True)).magnitude().max() < 1e-9


def test_cameras_of_colmap_are_where_they_see_the_world_from() -> None:
    (one,) = read_trajectories(str(LOGS / "colmap_images.txt"), ReadingOptions(frame_rate=10.0)).trajectories
    rows = [line.split() for line in (LOGS / "colmap_images.txt").read_text().splitlines() if line.endswith(".png")]
    seen = np.array([row[1:8] for row in rows], dtype=float)
    turns = Rotation.from_quat(seen[:, :4], scalar_first=True).inv()
    np.testing.assert_allclose(one.poses.positions, -turns.apply(seen[:, 4:]), atol=1e-9)
    np.testing.assert_allclose(
        Rotation.from_quat(one.poses.quaternions, scalar_first=True).as_matrix(), turns.as_matrix()
    )
    np.testing.assert_allclose(one.times, np.arange(40) / 10.0)


def circling(times: np.ndarray, speed: float) -> np.ndarray:
    return np.stack((0.0 * times, 0.0 * times, np.sin(speed * times / 2.0), np.cos(speed * times / 2.0)), axis=-1)


def test_rows_of_matrices_are_read() -> None:
    (one,) = read_trajectories(str(LOGS / "matrix_rows.csv")).trajectories
    table = np.loadtxt(LOGS / "matrix_rows.csv", delimiter=",", skiprows=1)
    matrices = table[:, 1:].reshape(-1, 4, 4)
    np.testing.assert_array_equal(one.times, table[:, 0])
    np.testing.assert_array_equal(one.poses.positions, matrices[:, :3, 3])
    turns = Rotation.from_quat(one.poses.quaternions, scalar_first=True)
    np.testing.assert_allclose(turns.as_matrix(), matrices[:, :3, :3], atol=2e-6)


def test_positions_and_rotations_in_rows_of_their_own_are_filled_in_between_their_own() -> None:
    recording = read_trajectories(str(LOGS / "staggered_rows.csv"))
    (one,) = recording.trajectories
    assert len(one.times) == 99
    angles = Rotation.from_quat(one.poses.quaternions, scalar_first=True).as_rotvec()[:, 2]
    # The position goes 1 cm a row, and the turn 0.02 a row; each rotation is a quarter of a microsecond late.
    np.testing.assert_allclose(angles, 2.0 * one.poses.positions[:, 0], atol=3e-5)
    assert "positions and rotations stand in different rows" in recording.note


def test_the_columns_of_euroc_are_read_whatever_the_file_is_called() -> None:
    (one,) = read_trajectories(str(LOGS / "mocap_eight_columns.txt")).trajectories
    assert len(one.times) == 200
    np.testing.assert_allclose(np.diff(one.times), 1.0 / 120.0, atol=1e-8)
    np.testing.assert_allclose(one.poses.quaternions[:, [1, 2, 3, 0]], circling(one.times, 1.2), atol=2e-6)


def test_either_end_of_a_quaternion_may_be_w_and_a_guess_is_said() -> None:
    (first,), (last,) = (read_trajectories(str(LOGS / f"w{end}.txt")).trajectories for end in ("first", "last"))
    np.testing.assert_array_equal(first.poses.quaternions, last.poses.quaternions)
    assert [str(warning) for warning in first.warnings] == [
        "its columns have no names, and the first of the four of a rotation is taken for w; if it is the other way "
        "round: --columns qx=5,qy=6,qz=7,qw=8"
    ]
    other = (("qx", "5"), ("qy", "6"), ("qz", "7"), ("qw", "8"))
    (swapped,) = read_trajectories(str(LOGS / "wfirst.txt"), ReadingOptions(columns=other)).trajectories
    np.testing.assert_array_equal(swapped.poses.quaternions[:, [1, 2, 3, 0]], first.poses.quaternions)
    assert last.warnings == ()


NAMED = {
    "keys_for_times.tum": "t counts up by 1 from 18295873486192640: these are numbers of rows or keys, not ti",
    "kitti.txt": "poses without times; say how many frames a second it has: --frame-rate 90",
    "colmap_images.txt": "no column of time, only one that counts frames ('frame'); say how many frames a second",
    "transforms.json": "no column of time, only one that counts frames ('frame'); say how many frames a second",
    "motive_no_assets.csv:7": "no rigid body in this take; export Rigid Bodies, too",
    "vicon_segments.csv:5": "rotations are Euler angles here (RX [deg], RY [deg], RZ [deg]), and",
}


@pytest.mark.parametrize("name", NAMED)
def test_what_is_missing_is_named_with_the_way_in(name: str) -> None:
    with pytest.raises(TrajectoryError) as caught:
        read_trajectories(str(LOGS / name.partition(":")[0]))
    assert str(caught.value).startswith(f"{LOGS / name}: {NAMED[name]}")


def test_rows_that_come_in_packets_are_a_warning() -> None:
    (clip,), _ = read_clips([str(LOGS / "batched.csv")])
    assert len(clip.times) == 8
    warning = clip.warnings[-1]
    assert warning.text.startswith(
        "32 of 40 rows are lost: dropped rows whose time comes again, keeping the last of each"
    )
    assert "number them in a column and add --frame-rate" in warning.way_out
