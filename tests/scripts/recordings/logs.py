"""CSV logs of one motion under many spellings of columns, in many units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

COUNT = 24
MICROSECONDS = 11_111 * np.arange(COUNT) + np.arange(COUNT) % 3 * 500
"""Times since the first sample: about 90 samples per second, with jitter."""

EPOCH = 1_700_000_000_000_000
"""Microseconds from 1970 to a day in 2023."""


@dataclass(frozen=True)
class Motion:
    """A recorded motion: metres, and quaternions x, y, z, w."""

    positions: np.ndarray
    turns: Rotation


def _motion(side: float) -> Motion:
    t = MICROSECONDS * 1e-6
    positions = np.stack((0.4 * side + 0.1 * np.sin(5.0 * t), 1.2 + 0.3 * t, 0.2 * np.cos(4.0 * t)), axis=-1)
    return Motion(positions, Rotation.from_rotvec(np.stack((side + 3.0 * t, 0.4 * t, 0.3 - t), axis=-1)))


MOTIONS = {"left": _motion(-1.0), "right": _motion(1.0)}

TIMES = {
    "s": "t;T;time;Time;timestamp;TimeStamp;Time (s);t [s];t_s;time_since_start_seconds;elapsed time;seconds;ts",
    "ms": "t [ms];t (ms);timestamp_ms;Time (ms);timestampMs;TimestampMS;time_in_milliseconds;ms;unix time (ms)",
    "us": "t_us;timestamp (us);time [\u00b5s];timeMicroseconds",
    "ns": "timestamp_ns;t [ns];Time_ns;header.stamp (ns)",
}
"""Column names by unit. {} is an axis, {!} an axis as a capital letter."""

POSITIONS = (
    "{};{!};p{};t{};pos_{};pos{!};Pos{!};PosX;position.{};position_{};Position {!};position[{}];m_LocalPosition.{};"
    "transform.translation.{};loc_{};Pos.{};field.pose.position.{};worldPosition{!};{} position"
).replace("PosX", "POS_{!}")
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


def spellings(text: str) -> list[str]:
    return text.split(";")


def spelled(template: str, axis: str) -> str:
    return template.replace("{!}", axis.upper()).replace("{}", axis)


def time_texts(unit: str, start: int) -> list[str]:
    """Return times as a logger writes them, to the microsecond; whole numbers for microseconds and nanoseconds."""
    ticks = [start + int(step) for step in MICROSECONDS]
    digits = {"s": 6, "ms": 3}
    if unit in digits:
        cut = digits[unit]
        return [f"{tick // 10**cut}.{tick % 10**cut:0{cut}}" for tick in ticks]
    return [str(tick * (1000 if unit == "ns" else 1)) for tick in ticks]


def pose_texts(motion: Motion, metres: float, rotations: np.ndarray) -> list[list[str]]:
    """Return a row of cells for every sample: the position in units of `metres` metres, and these rotations."""
    table = np.column_stack((motion.positions / metres, rotations))
    return [[repr(number) for number in row] for row in table.tolist()]


def written(header: Sequence[str], rows: Sequence[Sequence[str]], separator: str = ",") -> str:
    return "".join(separator.join(cells) + "\n" for cells in (header, *rows))


def names(
    time: str, position: str, rotation: str, axes: str = "xyzw", unit: str = "", prefixes: Sequence[str] = ("",)
) -> list[str]:
    """Return a header: the time, then for every prefix a position and a rotation about these axes."""
    header = [time]
    for prefix in prefixes:
        header += [f"{prefix}{spelled(position, axis)}{unit}" for axis in "xyz"]
        header += [f"{prefix}{spelled(rotation, axis)}" for axis in axes]
    return header


def log(header: Sequence[str], unit: str = "s", metres: float = 1.0, start: int = 0, side: str = "left") -> str:
    """Return a log of one body with a quaternion, under this header."""
    motion = MOTIONS[side]
    poses = pose_texts(motion, metres, motion.turns.as_quat())
    return written(header, [[time, *pose] for time, pose in zip(time_texts(unit, start), poses, strict=True)])


def assert_is_the_motion(trajectory: object, motion: Motion, *, start: int = 0, unit: str = "s") -> None:
    """Check that a trajectory is the motion: times to the last bit in the file, lengths to rounding."""
    seconds = trajectory.times - trajectory.times[0]
    ticks = {"s": 1e-6, "ms": 1e-3}
    lost = np.spacing((start + MICROSECONDS[-1]) * ticks[unit]) / (ticks[unit] * 1e6) if unit in ticks else 1e-15
    np.testing.assert_allclose(seconds, MICROSECONDS * 1e-6, rtol=1e-15, atol=2.0 * lost)
    positions = trajectory.poses.positions * trajectory.metres_per_unit
    np.testing.assert_allclose(positions, motion.positions, rtol=1e-15, atol=1e-16)
    turns = Rotation.from_quat(trajectory.poses.quaternions, scalar_first=True)
    assert (turns.inv() * motion.turns).magnitude().max() < 1e-7
    assert trajectory.warnings == ()


def named(columns: Mapping[str, Sequence[str]]) -> tuple[list[str], list[list[str]]]:
    """Return the header and the rows of columns of cells."""
    return list(columns), [list(row) for row in zip(*columns.values(), strict=True)]
