"""Times as seconds: in the unit that a file or a user says, and refused where neither does and seconds cannot be."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from rigid_motion.motion.repair import LARGEST

from .options import TICKS
from .recordings import TrajectoryError
from .tables import Table

SLOWEST = 5.0
"""Samples a second. Of poses there are hardly ever fewer: the slowest recordings of people that are known have 15."""

FASTEST = 5000.0
"""Samples a second. Trackers with markers reach 1000 to 2000; no device for poses has more."""

TOO_SLOW = 0.5
"""Samples a second. A hand is elsewhere after two seconds: no one records it so, and times in other units look so."""

ENOUGH = 2
"""Steps of time that tell a unit. A file of two samples says nothing of it."""

EXACT = 2.0**53
"""Number beyond which a float64 leaves out whole numbers, such as nanoseconds since 1970."""

LARGEST_WHOLE = 2.0**62
"""Number beyond which the difference of two whole numbers might be none that fits 64 bits."""

WILD = 10.0
"""Times further from the median than half of all others that a wild time is; of even times all are within two."""

LONG_NAMES = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}


def typical_interval(times: np.ndarray) -> float:
    """Return the median of the steps forward in times of shape (n,), whatever else is among them; NaN where none is.

    One wild time stamp, a clock that is set back and times that come twice make no difference to it.
    """
    forward = _steps_forward(times)
    return float(np.median(forward)) if len(forward) else np.nan


def _steps_forward(times: np.ndarray) -> np.ndarray:
    steps = np.diff(times[np.abs(times) < LARGEST])
    return steps[steps > 0.0]


def seconds_of(table: Table, ticks: np.ndarray, unit: str) -> np.ndarray:
    """Return the times of a table as seconds.

    Parameters
    ----------
    table : Table
        With a column t, which is read again where a float64 cannot hold its numbers.
    ticks : array, shape (n,)
        That column.
    unit : str
        A name in `TICKS`, or empty for seconds.

    Returns
    -------
    array, shape (n,)
        Seconds as they are in the file; of other units those since the earliest time, wild ones not counted: of a
        clock that counts from 1970 nothing is lost.
    """
    if TICKS.get(unit, 1.0) == 1.0 or not np.isfinite(ticks).any():
        return ticks
    if EXACT < np.nanmax(np.abs(ticks)) < LARGEST_WHOLE:
        # With fractions, or without a number in some row, they are not whole, and as near as floats are.
        with suppress(ValueError, OverflowError):
            ticks = np.fromiter((int(cell) for _, cell in table.cells("t")), np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        return (ticks - earliest(ticks)) / TICKS[unit]


def earliest(ticks: np.ndarray) -> float:
    """Return the earliest time, without wild ones."""
    usable = ticks[np.abs(ticks) < LARGEST]
    if not len(usable):
        return 0.0
    away = np.abs(usable - np.median(usable))
    return usable[away <= WILD * np.median(away)].min(initial=usable[np.argmin(away)])


def require_seconds(table: Table, times: np.ndarray, time_unit: str) -> None:
    """Refuse times whose unit nothing says, and that cannot be seconds.

    Parameters
    ----------
    table : Table
    times : array, shape (n,)
        Of one body.
    time_unit : str
        What the file or the user says; empty for nothing.
    """
    interval = typical_interval(times)
    if time_unit or len(_steps_forward(times)) < ENOUGH or interval <= 1.0 / TOO_SLOW:
        return
    likely = [unit for unit in LONG_NAMES if SLOWEST <= TICKS[unit] / interval <= FASTEST]
    problem = f"t goes in steps of {interval:.4g}: as seconds that is one sample in {interval:.3g} s"
    if likely:
        unit, rate = likely[0], TICKS[likely[0]] / interval
        way_out = f"these look like {LONG_NAMES[unit]} ({rate:.3g} samples a second): --time-unit {unit}"
        raise TrajectoryError(table.path, problem, f"{way_out}, or --time-unit s if they are seconds", table.header)
    way_out = f"say what it counts: --time-unit {', '.join(TICKS)}"
    raise TrajectoryError(table.path, problem, way_out, table.header or None)
