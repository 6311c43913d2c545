"""Tests of logs: columns in common spellings are the recorded motion, numbers are exact, dates are seconds."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion_batch.recordings import ReadingOptions, Trajectory, read_trajectories
from rigid_motion_batch.recordings.column_names import ColumnName, column_name
from rigid_motion_batch.recordings.columns import layout_of
from rigid_motion_batch.recordings.plausibility import MIN_MIXED_SAMPLES
from rigid_motion_batch.recordings.tables import HeaderLine
from tests.scripts.recordings.layouts import (
    COUNT,
    LEFT,
    MICROSECONDS,
    MOTIONS,
    SECONDS,
    Motion,
    angles,
    assert_is_the_motion,
    csv,
    names,
)
from tests.thoroughness import tried

EPOCH = 1_700_000_000_000_000
"""Microseconds from 1970 to a day in 2023."""

TIMES = {
    "s": "t;T;time;Time;timestamp;TimeStamp;Time (s);t [s];t_s;time_since_start_seconds;elapsed time;seconds;ts",
    "ms": "t [ms];t (ms);timestamp_ms;Time (ms);timestampMs;TimestampMS;time_in_milliseconds;ms;unix time (ms)",
    "us": "t_us;timestamp (us);time [\u00b5s];timeMicroseconds",
    "ns": "timestamp_ns;t [ns];Time_ns;header.stamp (ns)",
}
"""Column names by unit. {} is an axis, {!} an axis as a capital letter."""

POSITIONS = (
    "{};{!};p{};t{};pos_{};pos{!};Pos{!};POS_{!};position.{};position_{};Position {!};position[{}];m_LocalPosition.{};"
    "transform.translation.{};loc_{};Pos.{};field.pose.position.{};worldPosition{!};{} position"
)
QUATERNIONS = (
    "q{};Q{!};rot_{};Rot{!};rotation.{};quat_{};quaternion.{};orientation.{};r{};Rotation {!};m_LocalRotation.{};q_{};"
    "field.pose.orientation.{};rotation_quat_{};q[{}]"
)
EULERS = "r{};rot_{};Rot{!};euler_{};eulerAngles.{};rotation.{};orientation {};localEulerAngles.{}"
LENGTHS = {"m": ";_m; (m); [m]", "cm": "_cm; (cm); [cm]; [centimeters]", "mm": "_mm; (mm)"}
ANGLES = {"deg": "_deg; [deg]; (degrees)", "rad": "_rad; [rad]"}
DEVICES = "device;Device;hand;Controller;tracker_id;node name;body"
EXTRAS = "frame;button;velocity_x;velocity_y;velocity_z;delta_time;confidence;angular_velocity.x;hp"

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}

HEADER = "t,x,y,z,qx,qy,qz,qw"


def read_one(source: str, **options: object) -> Trajectory:
    (trajectory,) = read_trajectories(source, ReadingOptions(**options)).trajectories
    return trajectory


def time_texts(unit: str, start: int) -> list[str]:
    """Return times as a logger writes them, to the microsecond; whole numbers for microseconds and nanoseconds."""
    ticks = [start + int(step) for step in MICROSECONDS]
    digits = {"s": 6, "ms": 3}
    if unit in digits:
        cut = digits[unit]
        return [f"{tick // 10**cut}.{tick % 10**cut:0{cut}}" for tick in ticks]
    return [str(tick * (1000 if unit == "ns" else 1)) for tick in ticks]


@st.composite
def loggers(draw: st.DrawFn) -> tuple[str, ReadingOptions, str, int]:
    """Return a log of both motions in a random spelling, the options to read it, its unit of time and its start."""

    def spelling(of: str) -> str:
        return draw(st.sampled_from(of.split(";")))

    unit = draw(st.sampled_from(list(TIMES)))
    start = draw(st.sampled_from([0, EPOCH]))
    length = draw(st.sampled_from(list(LENGTHS)))
    position = spelling(POSITIONS) + spelling(LENGTHS[length])
    said: dict[str, object] = {"scale": METRES[length]} if position.endswith(("}", "position")) else {}
    order = draw(st.sampled_from([None, "YXZ", "ZYX", "zxy"]))
    angle = draw(st.sampled_from(list(ANGLES)))
    if order:
        suffix = spelling(f";{ANGLES[angle]}")
        rotation = spelling(EULERS) + suffix
        said |= {"euler": order, "degrees": angle == "deg"}
    else:
        rotation = spelling(QUATERNIONS)

    def columns_of(motion: Motion, prefix: str) -> dict[str, np.ndarray]:
        turns = angles(order, angle == "deg", motion) if order else motion.turns.as_quat()
        header = names(prefix + position, prefix + rotation, "xyz" if order else "xyzw")
        return dict(zip(header.split(","), np.hstack((motion.positions / METRES[length], turns)).T, strict=True))

    time = spelling(TIMES[unit])
    columns = {time: np.array(time_texts(unit, start))}
    if time in ("t", "T", "time", "Time", "timestamp", "TimeStamp", "ts", "elapsed time"):
        said["time_unit"] = unit
    if draw(st.booleans(), label="a body has columns of its own"):
        for side, motion in MOTIONS.items():
            columns |= columns_of(motion, f"{side}_")
    else:
        both = [columns | columns_of(motion, "") for motion in MOTIONS.values()]
        columns = {name: np.stack([one[name] for one in both], axis=1).ravel() for name in both[0]}
        columns[spelling(DEVICES)] = np.tile([*MOTIONS], COUNT)
    for extra in draw(st.lists(st.sampled_from(EXTRAS.split(";")), unique=True, max_size=3)):
        columns[extra] = np.full(len(columns[time]), "0.5")
    header = draw(st.permutations(list(columns)))
    separator = draw(st.sampled_from([",", ";", "\t"]))
    text = csv(",".join(header), *(columns[name] for name in header), separator=separator)
    if separator == ";" and draw(st.booleans()) and "." not in "".join(header):
        text = text.replace(".", ",")
    return text, ReadingOptions(**said), unit, start


@settings(max_examples=tried(100))
@given(loggers())
def test_any_spelling_any_unit_any_order_and_any_layout_is_the_motion(tmp_path_factory, logger):
    text, options, unit, start = logger
    path = Path(tmp_path_factory.getbasetemp()) / "logger.csv"
    path.write_text(text, encoding="utf-8")
    trajectories = read_trajectories(f"{path}:*", options).trajectories
    assert {trajectory.name for trajectory in trajectories} == set(MOTIONS)
    ticks = {"s": 1e-6, "ms": 1e-3}
    lost = np.spacing((start + MICROSECONDS[-1]) * ticks[unit]) / (ticks[unit] * 1e6) if unit in ticks else 1e-15
    for trajectory in trajectories:
        assert_is_the_motion(trajectory, MOTIONS[trajectory.name], SECONDS, clock=2.0 * lost, length=1e-16)
        assert trajectory.warnings == ()


def test_degrees_that_could_be_radians_are_told(write) -> None:
    source = write("take.csv", csv("t,x,y,z,rot_x,rot_y,rot_z", SECONDS, LEFT.positions, angles("XYZ", False)))
    (warning,) = read_one(source, euler="XYZ", degrees=True).warnings
    assert str(warning).endswith("radians need no --degrees")


numbers = st.floats(allow_nan=False, allow_infinity=False)
samples = st.lists(st.tuples(*[numbers] * 9), min_size=2, max_size=MIN_MIXED_SAMPLES - 1).map(np.array)
"""Too few samples for the check that looks for several mixed devices."""


@settings(max_examples=tried(60))
@given(samples, st.permutations(range(9)), st.sampled_from([",", ";", "\t"]))
def test_what_is_written_in_full_precision_comes_back_exactly(tmp_path_factory, table, order, separator):
    path = Path(tmp_path_factory.getbasetemp()) / "round_trip.csv"
    header = ["t", "x", "y", "z", "qw", "qx", "qy", "qz", "scale"]
    path.write_text(csv(",".join(header[column] for column in order), table[:, order], separator=separator))
    trajectory = read_one(str(path), time_unit="s")
    np.testing.assert_array_equal(trajectory.times, table[:, 0])
    np.testing.assert_array_equal(trajectory.poses.positions, table[:, 1:4])
    np.testing.assert_array_equal(trajectory.poses.quaternions, table[:, 4:8])
    scales = 1.0 if trajectory.poses.scales is None else trajectory.poses.scales
    np.testing.assert_array_equal(table[:, 8], scales)


def test_what_is_broken_in_the_recording_is_kept_for_the_repair(write) -> None:
    text = f"{HEADER}\n5,0,0,0,0,0,0,0\n5,nan,,NaN,0,0,0,-2\n4,inf,0,0,0,0,0,1\n"
    trajectory = read_one(write("take.csv", text))
    np.testing.assert_array_equal(trajectory.times, [5, 5, 4])
    np.testing.assert_array_equal(trajectory.poses.quaternions, [[0, 0, 0, 0], [-2, 0, 0, 0], [1, 0, 0, 0]])
    np.testing.assert_array_equal(trajectory.poses.positions[1], [np.nan] * 3)
    assert trajectory.poses.positions[2, 0] == np.inf


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        (["2026-11-22T10:00:00.123456789Z", "2026-11-22T10:00:00.373456789Z"], [0, 0.25]),
        (["2026-11-22 23:59:59.9", "2026-11-23 00:00:00.15"], [0, 0.25]),
        (['"2026-11-22 10:00:00.000001"', "2026-11-22 10:00:00.250001"], [0, 0.25]),
        (["0001-01-01T00:00:00", "0001-01-01T00:00:00.25"], [0, 0.25]),
        (["2026-10-25T02:59:59.9+02:00", "2026-10-25T02:00:00.15+01:00"], [0, 0.25]),
        (["2026-10-25T02:59:59.9+0200", "2026-10-25T01:00:00.15Z"], [0, 0.25]),
        (["2026-11-22 06:30:00 -0330", "2026-11-22 10:00:00.25Z"], [0, 0.25]),
        (["2016-12-31T23:59:60Z", "2017-01-01T00:00:00.25Z"], [0, 0.25]),
        (["10:00:00.123", "10:00:00.373"], [0, 0.25]),
        (["23:59:59.9", "00:00:00.15"], [0, 0.25]),
        (["00:30:00+01:00", "23:30:00.25Z"], [0, 0.25]),
        (["23:59:59.5", "00:00:00", "23:59:59.75", "00:00:00.25"], [0, 0.5, 0.25, 0.75]),
        (["10:00:00", "", "NaN", "10:00:00.25"], [0, np.nan, np.nan, 0.25]),
    ],
)
def test_dates_and_clock_times_are_seconds_from_the_first(write, times: list[str], seconds: list[float]) -> None:
    text = "".join(f"{time},1,2,3,0,0,0,1\n" for time in times)
    np.testing.assert_array_equal(read_one(write("log.csv", f"{HEADER}\n{text}")).times, seconds)


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
