"""Plausibility of a recording: warnings of speeds, sizes and sample rates that no hand, device or room has.

The limits are wide. Among the recordings by other people that this program is tested on, the fastest, a fast game, has
95 % of its speeds below 7.1 m/s, and the jumpiest has one sample at 19 m/s. All stay within 2.3 m, with 30 to 286
samples a second.

There are also warnings of breaks in the motion: an initial T-pose, gaps without samples, and jumps. For these, times
are strictly increasing and poses are repaired, as by `rigid_motion.motion.repair`. Seconds in texts count from the
first sample, like the options `--start` and `--end`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.repair import MAX_MEASURE, Repair

from .clips import ClipWarning
from .recordings import Trajectory, TrajectoryError, shown
from .rest_bodies import RestBody, size_of
from .times import MAX_SAMPLES_PER_S, MIN_SAMPLES_PER_S, typical_interval

HIGHEST_SPEED = 20.0
"""Metres a second, the limit for the 95th percentile of the speed: nearly three times that of a fast game. A resting
hand in centimetres passes as one in metres; a moving hand does not."""

MAX_ROOM_WIDTH_M = 100.0
"""Metres: more than the width of rooms and halls where people are tracked."""

LOOK_BACK = 8
"""Samples within which each device appears again, if a few devices take turns."""

MIN_NEARER_RATIO = 10.0
"""A sample does not follow the last one if an earlier sample is this many times nearer. In a well sampled motion, the
last sample is the nearest."""

SAME_TIME = 0.01
"""Metres between samples with the same timestamp that one device cannot have."""

MIN_MIXED_RATIO = 0.25
"""Share of samples that do not follow the last one, above which there are several devices. For two that take turns the
share is 1; for two in random order, half."""

MAX_ORIGIN_DISTANCE_M = 20.0
"""Metres from the origin, which lies in the room of the recording. A headset is 170 cm above it."""

MIN_MIXED_SAMPLES = 16
"""Samples needed to detect several devices."""


def require_one_body(trajectory: Trajectory, path: Path | str, way_out: str, line: int) -> None:
    """Raise an error if samples jump back and forth: those of several devices, read as one.

    Raises
    ------
    TrajectoryError
        With the speed of the jumps.
    """
    times, positions = _usable(trajectory)
    interval = typical_interval(times)
    if len(times) < MIN_MIXED_SAMPLES or not interval > 0.0:
        return
    jumps = np.linalg.norm(positions[LOOK_BACK:] - positions[LOOK_BACK - 1 : -1], axis=-1)
    nearest = np.full(len(jumps), np.inf)
    for lag in range(2, LOOK_BACK + 1):
        earlier = positions[LOOK_BACK - lag : len(positions) - lag]
        nearest = np.minimum(nearest, np.linalg.norm(positions[LOOK_BACK:] - earlier, axis=-1))
    steps = np.abs(np.diff(times)[LOOK_BACK - 1 :])
    with np.errstate(over="ignore"):
        speeds = jumps / np.where(steps > 0.0, steps, interval)
    impossible = (speeds > HIGHEST_SPEED) | ((steps == 0.0) & (jumps > SAME_TIME))
    mixed = impossible & (jumps > MIN_NEARER_RATIO * nearest)
    count = np.count_nonzero(mixed)
    if count > MIN_MIXED_RATIO * len(mixed):
        problem = (
            f"{count} of {len(times)} samples jump from one place to another and back, at "
            f"{np.median(speeds[mixed]):.3g} m/s: these are several devices"
        )
        raise TrajectoryError(path, problem, way_out, line)


def implausibilities(trajectory: Trajectory, *, time_unit: bool = False) -> tuple[ClipWarning, ...]:
    """Return warnings of implausible times and lengths in a recording.

    Parameters
    ----------
    trajectory : Trajectory
    time_unit : bool
        Whether the user can set the unit of time for its format.
    """
    times, positions = _usable(trajectory)
    # Tiny differences in time make speeds overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        return (*_timing_warnings(times, time_unit), *_length_warnings(times, positions))


def _usable(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return times in seconds and positions in metres of the undamaged samples; for a whole body those of its root."""
    rows = np.abs(trajectory.times) < MAX_MEASURE
    poses = trajectory.poses if trajectory.rest_body is None else trajectory.poses[0]
    positions = poses.positions
    rows &= (np.abs(positions) < MAX_MEASURE).all(axis=-1)
    return trajectory.times[rows], positions[rows] * trajectory.metres_per_unit


def _timing_warnings(times: np.ndarray, time_unit: bool) -> Iterator[ClipWarning]:
    interval = typical_interval(times)
    if not interval > 0.0:
        return
    way_out = "if its times are not seconds, --time-unit ms, us or ns" if time_unit else ""
    if interval > 1.0 / MIN_SAMPLES_PER_S:
        counted = time_unit and bool(np.all(np.rint(times) == times))
        yield ClipWarning(
            f"only {1.0 / interval:.2g} samples a second, fewer than any motion needs",
            "if it counts frames, --frame-rate 90, or how many there were a second; " * counted + way_out,
        )
    if interval < 1.0 / MAX_SAMPLES_PER_S:
        yield ClipWarning(f"{1.0 / interval:.3g} samples a second, more than any device has", way_out)


def _length_warnings(times: np.ndarray, positions: np.ndarray) -> Iterator[ClipWarning]:
    if len(times) < MIN_MIXED_SAMPLES:
        return
    steps = np.diff(times)
    forward = steps > 0.0
    speeds = np.linalg.norm(np.diff(positions, axis=0)[forward], axis=-1) / _without_short_steps(steps[forward])
    fast = float(np.percentile(speeds, 95.0)) if len(speeds) else 0.0
    low, high = np.percentile(positions, (1.0, 99.0), axis=0)
    extent, away = float(np.linalg.norm(high - low)), float(np.linalg.norm(low + high)) / 2.0
    units = "if its lengths are centimetres, --scale 0.01, if inches, --scale 0.0254, if millimetres, --scale 0.001"
    if fast > HIGHEST_SPEED or extent > MAX_ROOM_WIDTH_M:
        text = f"a twentieth of its speeds are above {fast:.3g} m/s, and it goes {extent:.3g} m far, as no hand does"
        yield ClipWarning(text, units)
    elif away > MAX_ORIGIN_DISTANCE_M and away > extent:
        yield ClipWarning(f"it stays {away:.3g} m away from its origin, and moves within {extent:.2g} m", units)


MAX_T_POSE_SAMPLES = 5
"""Samples at the start that may hold the same T-pose."""

MAX_HELD_POSE_RATIO = 1e-3
"""Fraction of its size by which a body may move while it holds a pose."""

MIN_T_POSE_JUMP_RATIO = 0.1
"""Smallest jump of a joint from a T-pose to the motion, as a fraction of the body's size."""

MIN_T_POSE_JUMP_FACTOR = 5.0
"""Factor by which this jump exceeds the largest step of any joint afterwards."""

MIN_FIRST_JUMP_FACTOR = 10.0
"""This factor if the first pose is no T-pose and no rest pose; its jump must also be faster than `HIGHEST_SPEED`."""

FIRST_JUMP_SAMPLES = 60
"""Samples after the T-pose that are compared with the jump."""

AT_REST = 0.02
"""Distance of joints from their rest positions, as a fraction of the body's size, that counts as the rest pose."""

MIN_T_POSE_SPAN_RATIO, MAX_T_POSE_DEPTH_RATIO = 0.75, 0.4
"""Smallest arm span and largest depth of a T-pose, as fractions of its largest extent."""

MIN_GAP_S = 0.2
"""Seconds: the longest interval between keys of a comparison, at 5 keys a second. No key falls into a longer gap."""

MIN_LOST_RATIO = 0.25
"""Share of dropped rows from which on dropping them is a loss, not a repair."""

MIN_ISOLATED_JUMP_FACTOR = 10.0
"""Factor by which a jump exceeds the steps of the samples around it."""

JUMP_REACH_SAMPLES = 8
"""Samples before and after a jump that are compared with it."""

MOST_JUMPS = 0.01
"""Share of samples up to which jumps are faults of single samples, and not a wrong unit."""

MOST_NAMED = 5
"""Number of gaps or jumps listed, the largest ones."""

BLOCK_SAMPLES = 4096
"""Samples of a body processed at once."""

LEAVE_OUT = "take a part without it: --start and --end"


def calibration_pose(
    times: np.ndarray, poses: Poses, rest_body: RestBody, metres: float
) -> tuple[int, ClipWarning | None]:
    """Find an initial pose that is not part of a whole body's motion.

    Returns
    -------
    samples : int
        Number of samples that hold a T-pose or the rest pose before the body jumps into its motion: 0 for none.
    warning : ClipWarning or None
        A warning of these samples, or of another pose before such a jump.
    """
    if len(times) < MIN_MIXED_SAMPLES:
        return 0, None
    places = rest_body.skeleton.in_root_space(poses[:, : MAX_T_POSE_SAMPLES + FIRST_JUMP_SAMPLES]).positions
    size = max(size_of(rest_body.parents, places[:, 0]), size_of(rest_body.parents, rest_body.rest.positions))
    steps = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    held = int(np.argmax(steps.max(axis=0) > MAX_HELD_POSE_RATIO * size)) + 1
    joint = int(np.argmax(steps[:, held - 1]))
    jump, others = steps[joint, held - 1], np.max(steps[:, held:], initial=0.0)
    speed = jump * metres / (times[held] - times[held - 1])
    described = (
        f"from there to the next {shown(rest_body.joints[joint])} jumps {jump * metres:.2g} m, and none jumps more "
        f"than {others * metres:.2g} m afterwards"
    )
    where = float(times[0]), float(times[held])
    kind = _pose_kind(places[:, 0], rest_body, size)
    if (
        kind
        and held <= MAX_T_POSE_SAMPLES
        and jump > max(MIN_T_POSE_JUMP_RATIO * size, MIN_T_POSE_JUMP_FACTOR * others)
    ):
        frames = "its first frame is" if held == 1 else f"its first {held} frames are"
        return held, ClipWarning(f"{frames} {kind} and left out: {described}", "--start 0 keeps it", *where)
    if held == 1 and speed > HIGHEST_SPEED and jump > MIN_FIRST_JUMP_FACTOR * others:
        text = f"its first sample is a pose of its own, perhaps the T-pose before a recording: {described}; "
        way_out = f"leave it out: --start {times[1] - times[0]:.3g}"
        return 0, ClipWarning(text + "errors around it say nothing of the motion", way_out, *where)
    return 0, None


def _pose_kind(places: np.ndarray, rest_body: RestBody, size: float) -> str:
    """Return "a T-pose" (in any axes) or "the pose at rest" for places (joints, 3); empty for any other pose."""
    smallest, middle, largest = np.sort(np.ptp(places, axis=0))
    if middle > MIN_T_POSE_SPAN_RATIO * largest and smallest < MAX_T_POSE_DEPTH_RATIO * largest:
        return "a T-pose"
    away = places - rest_body.rest.positions
    return "the pose at rest" if np.abs(away - away[0]).max() < AT_REST * size else ""


def losses(repairs: Sequence[Repair], count: int) -> tuple[list[ClipWarning], list[Repair]]:
    """Return warnings of repairs that drop a large share of the `count` rows of a recording, and the other repairs."""
    costly = [
        repair
        for repair in repairs
        if repair.fault.startswith("dropped") and len(repair.rows) >= MIN_LOST_RATIO * count
    ]
    warnings = []
    for repair in costly:
        way_out = "if tracking was lost there, take a part without it: --start and --end"
        if "comes again" in repair.fault:
            way_out = "if its rows come in packets with one time, number them in a column and add --frame-rate"
        elif "runs backwards" in repair.fault:
            way_out = (
                "these are several recordings or devices: split the file, or name the column of devices, --columns "
            )
            way_out += "device=NAME"
        warnings.append(ClipWarning(f"{len(repair.rows)} of {count} rows are lost: {repair}", way_out))
    return warnings, [repair for repair in repairs if repair not in costly]


def breaks(
    times: np.ndarray, poses: Poses, rest_body: RestBody | None, metres: float, begin: float
) -> list[ClipWarning]:
    """Return warnings of gaps longer than the time between keys, and of jumps, in order of time.

    `metres` is the length of the poses' unit, `begin` the time of the first sample of the recording.
    """
    steps = np.diff(times)
    result = [*_gaps(times, steps, begin)]
    if len(times) >= MIN_MIXED_SAMPLES:
        result += _jumps(times, steps, np.concatenate(list(_lengths(poses, rest_body))) * metres, begin)
    return sorted(result, key=lambda warning: warning.start_s or 0.0)


def _gaps(times: np.ndarray, steps: np.ndarray, begin: float) -> Iterator[ClipWarning]:
    gaps = np.flatnonzero((steps > MIN_GAP_S) & (steps > MIN_ISOLATED_JUMP_FACTOR * np.median(steps)))
    for row in _largest(steps, gaps):
        first, last = times[row : row + 2].tolist()
        text = f"no samples from {first - begin:.2f} s to {last - begin:.2f} s{_one_of(gaps, 'gaps')}"
        yield ClipWarning(f"{text}: no error is measured there", LEAVE_OUT, first, last)


def _jumps(times: np.ndarray, steps: np.ndarray, lengths: np.ndarray, begin: float) -> Iterator[ClipWarning]:
    steps = _without_short_steps(steps)
    fast = np.flatnonzero(lengths > HIGHEST_SPEED * steps)
    if len(fast) > MOST_JUMPS * len(steps):
        return
    around = [lengths[max(0, row - JUMP_REACH_SAMPLES) : row + JUMP_REACH_SAMPLES + 1] for row in fast]
    usual = np.array([np.median(lengths) for lengths in around])
    jumps = fast[lengths[fast] > MIN_ISOLATED_JUMP_FACTOR * usual]
    for row in _largest(lengths, jumps):
        first, last = times[row : row + 2].tolist()
        text = f"a jump at {first - begin:.2f} s{_one_of(jumps, 'jumps')}: {lengths[row]:.2g} m in one sample, at "
        text += f"{lengths[row] / steps[row]:.3g} m/s, where tracking was lost or takes were joined"
        yield ClipWarning(text, LEAVE_OUT, first, last)


def _without_short_steps(steps: np.ndarray) -> np.ndarray:
    """Return steps forward, raised to at least half the median: late timestamps do not mean high speed."""
    return np.maximum(steps, np.median(steps) / 2.0) if len(steps) else steps


def _lengths(poses: Poses, rest_body: RestBody | None) -> Iterator[np.ndarray]:
    """Yield the step of a body (or of its fastest joint) from each sample to the next, block by block."""
    count = poses.shape[-1]
    for first in range(0, count - 1, BLOCK_SAMPLES):
        part = poses[..., first : first + BLOCK_SAMPLES + 1]
        places = part.positions[None] if rest_body is None else rest_body.skeleton.in_root_space(part).positions
        yield np.linalg.norm(np.diff(places, axis=1), axis=-1).max(axis=0)


def _largest(sizes: np.ndarray, rows: np.ndarray) -> list[int]:
    return sorted(rows[np.argsort(-sizes[rows], kind="stable")][:MOST_NAMED].tolist())


def _one_of(rows: np.ndarray, what: str) -> str:
    return f" (one of {len(rows)} {what})" if len(rows) > 1 else ""
