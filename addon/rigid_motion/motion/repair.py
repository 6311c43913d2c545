"""Repair: turns a recording as delivered by a device into poses that can be interpolated.

Rows are dropped, quaternions normalised and their signs aligned. No data is invented, and every change is reported.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses
from .poses import MIN_TIME_GAP, Poses, numbers
from .quaternions import align_signs, normalise

MIN_GAP_INTERVALS = 1.75
"""A longer pause, in median intervals, is reported as a gap: timer jitter stays below, a lost sample is above."""

MOST_STRAYS = 0.05
"""The largest fraction of rows at either end that may be strays: rows with a wild time, not part of the recording."""

MIN_STRAY_DISTANCE_RATIO = 10.0
"""The least distance of strays from the other rows, as a multiple of the duration of those rows."""

MOST_NAMED = 5
"""The most rows that a message lists for one kind of fault."""

MAX_MEASURE = 1e30
"""A larger number is damage. The limit is well within what can be interpolated, as splines overshoot."""

LARGEST_SCALE = 1e6
"""A scale above this, or below its inverse, is damage: growth is exponential and would exceed the range of floats."""

UNIT_TOLERANCE = 1e-3
"""How far a quaternion's length may be from 1 before normalising is reported: many files keep three decimals."""


@dataclass(frozen=True)
class Repair:
    """One kind of fault found by `repair`. `str()` gives a sentence.

    See Also
    --------
    repair : Finds and repairs faults.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Repair
    >>> print(Repair("undid sign flips of quaternions", np.array([3, 8])))
    undid sign flips of quaternions (2: row 3, 8)
    """

    fault: str
    """The fault, and what was done about it."""

    rows: np.ndarray
    """The affected rows of the recording, from 0. For a gap, the row after it."""

    def __str__(self) -> str:
        shown = ", ".join(str(row) for row in self.rows[:MOST_NAMED].tolist())
        return f"{self.fault} ({len(self.rows)}: row {shown}{', ...' if len(self.rows) > MOST_NAMED else ''})"


def repair(times: ArrayLike, poses: Poses, rate: float | None = None) -> tuple[np.ndarray, Poses, list[Repair]]:
    """Make a recording fit for interpolation.

    Parameters
    ----------
    times : array-like, shape (n,)
        Seconds, as recorded.
    poses : Poses, shape (n,) or (joints, n)
        As recorded, in any unit: rows of NaN, quaternions of any length and sign. With several joints, a fault of one
        joint counts for the whole row.
    rate : float, optional
        Samples per second; intervals that are clearly longer count as gaps. The default is that of the median interval.

    Returns
    -------
    times : array, shape (m,)
        Strictly rising.
    poses : Poses, shape (m,) or (joints, m)
        Finite, with unit quaternions, each in the hemisphere of the one before.
    repairs : list of Repair
        The changes, in the order in which they were made; empty for a recording without faults.

    Raises
    ------
    TypeError
        If the recording is not a `Poses`.
    ValueError
        If there are not as many times as poses. No other fault of a recording is an error.

    See Also
    --------
    reduce_keys : Few keys of a repaired recording.

    Notes
    -----
    Of several rows with the same time the last is kept, as it is the newest. If times run backwards, as few rows as
    possible are dropped, so that one wild timestamp does not cost the rest of the recording. A wild timestamp at an end
    does not make the recording last for years. Gaps stay gaps.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, repair
    >>> poses = Poses([[0, 0, 0], [np.nan, 0, 0], [2, 0, 0]], [[2, 0, 0, 0], [1, 0, 0, 0], [-1, 0, 0, 0]])
    >>> times, poses, repairs = repair([0.0, 0.1, 0.2], poses)
    >>> poses.quaternions[:, 0].tolist()
    [1.0, 1.0]
    >>> times.tolist(), len(repairs)
    ([0.0, 0.2], 3)
    >>> print(repairs[0])
    dropped rows with numbers that are missing, not finite or too large (1: row 1)
    """
    check_poses(poses, "poses")
    times = numbers(times, "times")
    if times.ndim != 1 or poses.shape[-1:] != times.shape:
        raise ValueError(f"times of shape {times.shape} do not fit poses of shape {poses.shape}")
    repairs: list[Repair] = []
    rows = np.arange(len(times))

    def keep(good: np.ndarray, fault: str) -> None:
        nonlocal times, poses, rows
        if not good.all():
            repairs.append(Repair(fault, rows[~good]))
            times, poses, rows = np.asarray(times)[good], poses[..., good], rows[good]

    of_joints = tuple(range(len(poses.shape) - 1))
    finite = _usable(poses.positions).all(axis=-1) & _usable(poses.quaternions).all(axis=-1)
    if poses.scales is not None:
        finite &= (poses.scales < LARGEST_SCALE) & (poses.scales > 1.0 / LARGEST_SCALE)
    keep(
        _usable(times) & finite.all(axis=of_joints),
        "dropped rows with numbers that are missing, not finite or too large",
    )
    long_enough = np.linalg.norm(poses.quaternions, axis=-1) > 1e-6
    keep(long_enough.all(axis=of_joints), "dropped poses with a quaternion of length zero")
    forward = rising(times)
    keep(forward, f"dropped rows whose time runs backwards, such as {_first_time_text(times, ~forward)}")
    inliers = _time_inliers(times)
    keep(
        inliers, f"dropped rows whose time is far from that of all others, such as {_first_time_text(times, ~inliers)}"
    )
    keep(np.diff(times, append=np.inf) > MIN_TIME_GAP, "dropped rows whose time comes again, keeping the last of each")

    lengths = np.linalg.norm(poses.quaternions, axis=-1)
    if (uneven := (np.abs(lengths - 1.0) > UNIT_TOLERANCE).any(axis=of_joints)).any():
        repairs.append(Repair("normalised quaternions whose length was not 1", rows[uneven]))
    quaternions = normalise(poses.quaternions)
    aligned = align_signs(quaternions)
    turned = np.any(aligned != quaternions, axis=-1)
    if (flips := np.diff(turned, prepend=False).any(axis=of_joints)).any():
        repairs.append(Repair("undid sign flips of quaternions", rows[flips]))
    intervals = np.diff(times)
    if (
        len(intervals)
        and (gaps := intervals > MIN_GAP_INTERVALS * (1.0 / rate if rate else np.median(intervals))).any()
    ):
        longest = f"left gaps as they are, the longest {intervals.max() * 1e3:.0f} ms"
        repairs.append(Repair(longest, rows[1:][gaps]))
    return times, Poses(poses.positions, aligned, poses.scales), repairs


def _time_inliers(times: np.ndarray) -> np.ndarray:
    """Return a mask of rising times without the few strays at either end that are far from all others."""
    ends = int(MOST_STRAYS * len(times))
    first, last = (times[ends], times[-1 - ends]) if len(times) else (0.0, 0.0)
    reach = MIN_STRAY_DISTANCE_RATIO * (last - first) if last > first else np.inf
    return (times >= first - reach) & (times <= last + reach)


def _first_time_text(times: np.ndarray, rows: np.ndarray) -> str:
    """Return the first time in the rows of a mask as text, empty if there is none."""
    return f"{times[rows][0]:.6g} s" if rows.any() else ""


def _usable(numbers: np.ndarray) -> np.ndarray:
    """Return a mask of numbers that are finite and of a plausible size. Comparisons with NaN are False."""
    return np.abs(numbers) < MAX_MEASURE


def rising(times: np.ndarray) -> np.ndarray:
    """Return a mask of the longest non-decreasing subsequence of `times`: all of them, if the recording is sound."""
    if np.all(np.diff(times) >= 0.0):
        return np.ones(len(times), dtype=bool)
    # Patience sorting: the smallest last time of a subsequence of each length, and the row before each row.
    lasts: list[tuple[float, int]] = []
    before = np.full(len(times), -1)
    for row, time in enumerate(times.tolist()):
        index = bisect_left(lasts, (time, row))
        if index:
            before[row] = lasts[index - 1][1]
        lasts[index : index + 1] = [(time, row)]
    kept = np.zeros(len(times), dtype=bool)
    row = lasts[-1][1]
    while row >= 0:
        kept[row] = True
        row = before[row]
    return kept
