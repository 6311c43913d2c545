"""Sense of a recording: what no hand, no device and no room has is said, whatever the file claims.

The limits are wide. Of the recordings by other people that this program is tried on, the fastest, a fast game, has
95 % of its speeds below 7.1 m/s, and the jumpiest one sample at 19 m/s; all stay within 2.3 m, with 30 to 286 samples
a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rigid_motion.motion.repair import LARGEST, rising

from .clips import ClipWarning
from .recordings import Trajectory, TrajectoryError
from .times import FASTEST, SLOWEST, typical_interval

HIGHEST_SPEED = 20.0
"""Metres a second, which 95 % of the speeds are below: nearly three times what a fast game has. A hand at rest in
centimetres passes for one in metres; one that moves does not."""

WIDEST = 100.0
"""Metres: wider than rooms and halls where people are tracked."""

LOOK_BACK = 8
"""Samples among which those of one device come again, where a few take turns."""

NEARER = 10.0
"""Times nearer to an earlier sample than to the last one that a sample has to be, not to follow the last. Along
any motion that is sampled well the last one is the nearest."""

SAME_TIME = 0.01
"""Metres between samples of one time that one device does not have."""

MIXED = 0.25
"""The share of samples that do not follow the last one, from which on there are several devices. Of two that take turns
it is all; of two in any order, half."""

FURTHEST = 20.0
"""Metres from the origin of a recording, which lies in the room where it was made. A headset is 170 cm above it."""

FEWEST = 16
"""Samples that are enough to see that."""


def require_one_body(trajectory: Trajectory, path: Path | str, way_out: str, line: int) -> None:
    """Refuse samples that jump to and fro between places: those of several devices, taken for one.

    Raises
    ------
    TrajectoryError
        With the speed at which they would have to jump.
    """
    times, positions = _usable(trajectory)
    interval = typical_interval(times)
    if len(times) < FEWEST or not interval > 0.0:
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
    mixed = impossible & (jumps > NEARER * nearest)
    count = np.count_nonzero(mixed)
    if count > MIXED * len(mixed):
        problem = (
            f"{count} of {len(times)} samples jump from one place to another and back, at "
            f"{np.median(speeds[mixed]):.3g} m/s: these are several devices"
        )
        raise TrajectoryError(path, problem, way_out, line)


def doubts(trajectory: Trajectory, *, time_unit: bool = False) -> tuple[ClipWarning, ...]:
    """Return what of a recording is hard to believe.

    Parameters
    ----------
    trajectory : Trajectory
    time_unit : bool
        Whether its format takes the unit of time from the user.
    """
    times, positions = _usable(trajectory)
    # Speeds between times that are next to nothing apart leave the range of floats.
    with np.errstate(over="ignore", invalid="ignore"):
        return (*_of_times(times, time_unit), *_of_lengths(times, positions))


def _usable(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions, in seconds and metres, of samples with no damage in both; of a body its root's."""
    rows = np.abs(trajectory.times) < LARGEST
    positions = trajectory.rigid.positions
    rows &= (np.abs(positions) < LARGEST).all(axis=-1)
    return trajectory.times[rows], positions[rows] * trajectory.metres_per_unit


def _of_times(times: np.ndarray, time_unit: bool) -> Iterator[ClipWarning]:
    interval = typical_interval(times)
    if not interval > 0.0:
        return
    way_out = "if its times are no seconds, --time-unit ms, us or ns" if time_unit else ""
    if interval > 1.0 / SLOWEST:
        counted = time_unit and bool(np.all(np.rint(times) == times))
        yield ClipWarning(
            f"only {1.0 / interval:.2g} samples a second, fewer than any motion needs",
            "if it counts frames, --frame-rate 90, or how many there were a second; " * counted + way_out,
        )
    if interval < 1.0 / FASTEST:
        yield ClipWarning(f"{1.0 / interval:.3g} samples a second, more than any device has", way_out)
    lost = np.count_nonzero(~rising(times))
    if lost > MIXED * len(times):
        row = 1 + np.flatnonzero(np.diff(times) < 0.0)[0]
        yield ClipWarning(
            f"its time runs backwards at row {row}, and {lost} of {len(times)} rows are lost to that: these are "
            "several recordings or devices",
            "split the file, or name the column of devices, --columns device=NAME",
        )


def _of_lengths(times: np.ndarray, positions: np.ndarray) -> Iterator[ClipWarning]:
    if len(times) < FEWEST:
        return
    steps = np.diff(times)
    forward = steps > 0.0
    speeds = np.linalg.norm(np.diff(positions, axis=0)[forward], axis=-1) / steps[forward]
    fast = float(np.percentile(speeds, 95.0)) if len(speeds) else 0.0
    low, high = np.percentile(positions, (1.0, 99.0), axis=0)
    extent, away = float(np.linalg.norm(high - low)), float(np.linalg.norm(low + high)) / 2.0
    units = "if its lengths are centimetres, --scale 0.01, if inches, --scale 0.0254, if millimetres, --scale 0.001"
    if fast > HIGHEST_SPEED or extent > WIDEST:
        text = f"a twentieth of its speeds are above {fast:.3g} m/s, and it goes {extent:.3g} m far, as no hand does"
        yield ClipWarning(text, units)
    elif away > FURTHEST and away > extent:
        yield ClipWarning(f"it stays {away:.3g} m away from its origin, and moves within {extent:.2g} m", units)
