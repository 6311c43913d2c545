"""Repair: from a recording as devices deliver it to poses that can be interpolated.

Rows are dropped, quaternions normalised and their signs aligned; nothing is invented. Whatever was done is said.
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
"""A pause of more median intervals than this is reported as a gap: timer jitter stays below, a lost sample is above."""

MOST_STRAYS = 0.05
"""The share of the rows that at either end may be strays, whose time is wild, and no part of the recording."""

MIN_STRAY_DISTANCE_RATIO = 10.0
"""How many times further away than all the rest lasts strays are: nobody waits so long for so few samples."""

MOST_NAMED = 5
"""Rows that are named of one kind of fault."""

MAX_MEASURE = 1e30
"""A number beyond this is damage, and well within what can be interpolated: splines shoot over."""

LARGEST_SCALE = 1e6
"""A scale beyond this, or below its inverse, is damage: growth goes by powers, and would leave the range of floats."""

UNIT_TOLERANCE = 1e-3
"""How far a quaternion's length may be from 1 before normalising it is reported: three decimals are often kept."""


@dataclass(frozen=True)
class Repair:
    """One kind of fault that was found. As a string it is a sentence.

    See Also
    --------
    repair : What finds and repairs it.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Repair
    >>> print(Repair("undid sign flips of quaternions", np.array([3, 8])))
    undid sign flips of quaternions (2: row 3, 8)
    """

    fault: str
    """What it was, and what was done about it."""

    rows: np.ndarray
    """The rows of the recording where, from 0. For a gap, the row after it."""

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
        As recorded, in any unit: rows of NaN, quaternions of any length and sign. Of several joints a row is as good as
        its worst.
    rate : float, optional
        Samples a second, which longer intervals are gaps in. Without, it is that of the median interval.

    Returns
    -------
    times : array, shape (m,)
        Strictly rising.
    poses : Poses, shape (m,) or (joints, m)
        Finite, with unit quaternions in successive hemispheres.
    repairs : list of Repair
        What was done, in the order it was done; empty for a recording without a fault.

    Raises
    ------
    TypeError
        Where the recording is no `Poses`.
    ValueError
        Where there are not as many times as poses. No other fault of a recording is an error.

    See Also
    --------
    reduce_keys : Few keys of a repaired recording.

    Notes
    -----
    Of several rows with one time the last is kept, being the newest. Of times that run backwards, as few rows are
    dropped as can be, so that one wild time stamp does not cost the rest of the recording; nor does one at an end make
    it last for years. Gaps stay gaps.

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
    keep(forward, f"dropped rows whose time runs backwards, such as {_first(times, ~forward)}")
    near = _near(times)
    keep(near, f"dropped rows whose time is far from that of all others, such as {_first(times, ~near)}")
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


def _near(times: np.ndarray) -> np.ndarray:
    """Return a mask of rising times without those few at either end that are far from all between."""
    ends = int(MOST_STRAYS * len(times))
    first, last = (times[ends], times[-1 - ends]) if len(times) else (0.0, 0.0)
    reach = MIN_STRAY_DISTANCE_RATIO * (last - first) if last > first else np.inf
    return (times >= first - reach) & (times <= last + reach)


def _first(times: np.ndarray, rows: np.ndarray) -> str:
    """Return the first time in the rows of a mask, to be read; nothing where there is none."""
    return f"{times[rows][0]:.6g} s" if rows.any() else ""


def _usable(numbers: np.ndarray) -> np.ndarray:
    """Which numbers are there, finite and of a size that anything has: NaN is neither small nor large."""
    return np.abs(numbers) < MAX_MEASURE


def rising(times: np.ndarray) -> np.ndarray:
    """Return a mask of the longest part of `times` that never falls: the whole, where the recording is sound."""
    if np.all(np.diff(times) >= 0.0):
        return np.ones(len(times), dtype=bool)
    # Longest non-decreasing subsequence by patience sorting: the smallest last time of each length, and who was before.
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
