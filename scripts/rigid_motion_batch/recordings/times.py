"""Times converted to seconds, in the unit that the file or user states, or else the unit that gives a plausible rate.

Dates and clock times are exact to the nanosecond, as seconds since the earliest of them. Dates are those of ISO 8601 in
its extended format, with `T` or a blank before the clock time, and with or without an offset from UTC:
`2026-11-22T10:00:00.123456Z`, `2026-11-22 10:00:00+01:00`. A clock time is `10:00:00.123`. All times of a column must
be of the same kind as the first.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np

from rigid_motion.motion.repair import MAX_MEASURE

from .options import TICKS_PER_S_BY_UNIT
from .recordings import TrajectoryError, shown
from .tables import DAMAGED_ADVICE, HeaderLine, is_number

MIN_SAMPLES_PER_S = 5.0
"""Samples a second. Pose recordings hardly ever have fewer: the slowest known ones of people have 15."""

MAX_SAMPLES_PER_S = 5000.0
"""Samples a second. Marker trackers reach 1000 to 2000; no pose device has more than this."""

TOO_SLOW = 0.5
"""Samples a second. A hand is elsewhere after two seconds: fewer samples mean that times are not in seconds."""

MIN_UNIT_STEPS = 2
"""Steps of time needed to guess a unit. A file of two samples does not allow it."""

SINCE_1970 = 1e9, 4e9
"""Seconds from 1970 to 2001 and to 2096: clocks between these count from 1970."""

MAX_EXACT_INTEGER = 2.0**53
"""Limit above which a float64 skips whole numbers, such as nanoseconds since 1970."""

LARGEST_WHOLE = 2.0**62
"""Limit above which the difference of two whole numbers might not fit 64 bits."""

MIN_WILD_TIME_RATIO = 10.0
"""An outlier is farther from the median than this multiple of the median distance. Even times are within two."""

LONG_NAMES = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}


def typical_interval(times: np.ndarray) -> float:
    """Return the median of the forward steps in times of shape (n,), ignoring all other steps; NaN if there are none.

    A single wrong timestamp, a clock that is set back, and repeated times do not affect it.
    """
    forward = _steps_forward(times)
    return float(np.median(forward)) if len(forward) else np.nan


def _steps_forward(times: np.ndarray) -> np.ndarray:
    steps = np.diff(times[np.abs(times) < MAX_MEASURE])
    return steps[steps > 0.0]


def whole_ticks(header: HeaderLine, column: int) -> np.ndarray:
    """Return the numbers in a column of times, shape (rows,), as integers if they are too large for a float64."""
    ticks = header.numbers_below({"t": column})[:, 0]
    if MAX_EXACT_INTEGER < np.nanmax(np.abs(ticks), initial=0.0) < LARGEST_WHOLE:
        # Fractions and missing numbers are no integers: then the floats are returned.
        with suppress(ValueError, OverflowError):
            return np.fromiter((int(cell) for _, cell in header.cells_below(column)), np.int64)
    return ticks


def seconds_of(ticks: np.ndarray, a_second: float) -> np.ndarray:
    """Return times (n,), given with `a_second` ticks per second, as seconds.

    Times in seconds are unchanged. Others count from the earliest time that is not an outlier, so that clocks that
    count from 1970 lose no precision.
    """
    if a_second == 1.0 or not np.isfinite(ticks).any():
        return ticks.astype(float)
    with np.errstate(over="ignore", invalid="ignore"):
        return (ticks - earliest(ticks)) / a_second


def earliest(ticks: np.ndarray) -> float:
    """Return the earliest time that is not an outlier."""
    usable = ticks[np.abs(ticks) < MAX_MEASURE]
    if not len(usable):
        return 0.0
    away = np.abs(usable - np.median(usable))
    return usable[away <= MIN_WILD_TIME_RATIO * np.median(away)].min(initial=usable[np.argmin(away)])


def unit_by_rate(header: HeaderLine, ticks: np.ndarray) -> tuple[str, str]:
    """Return the guessed unit of times (n,) of one body, and a remark on the guess; both are empty for seconds.

    Some clocks count from 1970. Otherwise, usually only one of milliseconds, microseconds and nanoseconds gives a rate
    that devices have.

    Raises
    ------
    TrajectoryError
        If no unit fits, or the times are row numbers.
    """
    interval = typical_interval(ticks)
    if len(_steps_forward(ticks)) < MIN_UNIT_STEPS:
        return "", ""
    usual = abs(float(np.nanmedian(ticks)))
    if interval <= 1.0 / TOO_SLOW and usual < MAX_EXACT_INTEGER:
        return "", ""
    if np.all(np.diff(ticks) == 1):
        problem = f"t counts up by 1 from {ticks[0]:.0f}: these are numbers of rows or keys, not times"
        raise header.error(problem, "say how many rows a second there are, --frame-rate 90, or name a column of times")
    dated = [unit for unit in TICKS_PER_S_BY_UNIT if SINCE_1970[0] < usual / TICKS_PER_S_BY_UNIT[unit] < SINCE_1970[1]]
    likely = dated or [
        unit for unit in LONG_NAMES if MIN_SAMPLES_PER_S <= TICKS_PER_S_BY_UNIT[unit] / interval <= MAX_SAMPLES_PER_S
    ]
    if likely == ["s"]:
        return "", ""
    if not likely:
        problem = f"t goes in steps of {interval:.4g}: as seconds that is one sample in {interval:.3g} s"
        raise header.error(problem, f"say what it counts: --time-unit {', '.join(TICKS_PER_S_BY_UNIT)}")
    rate = TICKS_PER_S_BY_UNIT[likely[0]] / interval
    said = f"times are taken for {LONG_NAMES[likely[0]]}, {rate:.3g} samples a second"
    return likely[0], f"{said}, as seconds would be {interval:.3g} s apart (otherwise: --time-unit)"


MOMENT = re.compile(
    r"(?:(\d{4}-\d\d-\d\d)[T ])?(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?(?: ?(Z|[+-]\d\d(?::?\d\d)?))?",
    re.ASCII | re.IGNORECASE,
)
"""Day, hour, minute, second, fraction and offset. Java omits seconds that are 0, and Python omits a digit of hours."""

LIKE_A_DATE = re.compile(r"\d[:/]\d|\d[-.]\d\d?[-.]\d|\d{8}T\d", re.ASCII)
"""Pattern of dates in other formats."""

CLOCK_TIME = "a clock time"

MIDNIGHT = datetime(1970, 1, 1, tzinfo=UTC)

LEAP_SECOND = 60
"""Number of the leap second at the end of some minutes."""

DAY_S = 86_400
"""Seconds of a day."""

MAX_MEDIAN_DISTANCE_S = 2**61 // 10**9
"""Seconds from the median, 73 years. Times farther away are outliers, moved to this distance: so the difference of any
two times is a number of nanoseconds that fits 64 bits."""

MISSING_TIME_NS = -1
"""Value of nanoseconds for a row without a time."""

LONGEST_SHOWN = 40
"""Characters of a time in an error, as long as the longest time."""


def kind_of_times(header: HeaderLine, column: int) -> str | None:
    """Return the kind of times in a column, judged by the first one; None for numbers.

    Raises
    ------
    TrajectoryError
        If it is a date in an unknown format.
    """
    number, cell = next(
        ((number, cell) for number, cell in header.cells_below(column) if not _is_missing(cell)), (0, "")
    )
    if match := MOMENT.fullmatch(cell):
        return _kind(match)
    if LIKE_A_DATE.search(cell) and not is_number(cell):
        problem = f"t is {shown(cell, LONGEST_SHOWN)}, neither a number nor a date that can be read"
        way_out = "write 2026-11-22T10:00:00.123, 10:00:00.123 or seconds"
        raise TrajectoryError(header.path, problem, way_out, number)
    return None


def seconds_of_dates(header: HeaderLine, column: int, kind: str) -> np.ndarray:
    """Return the times in a column of dates or clock times.

    Parameters
    ----------
    header : HeaderLine
        Above rows that are long enough.
    column : int
    kind : str
        The kind of all its times.

    Returns
    -------
    array, shape (rows,)
        Seconds since the earliest time that is not an outlier; empty cells are NaN. A clock that falls by more than
        half a day has passed midnight.

    Raises
    ------
    TrajectoryError
        With the line number, for cells that hold no time of this kind.
    """
    moments = np.fromiter(_moments(header, column, kind), np.dtype((np.int64, 2)))
    known = moments[:, 1] != MISSING_TIME_NS
    seconds, nanoseconds = moments[known].T
    if kind.startswith(CLOCK_TIME):
        seconds = _through_midnights(seconds)
    times = np.full(len(moments), np.nan)
    if len(seconds):
        away = np.clip(seconds - int(np.median(seconds)), -MAX_MEDIAN_DISTANCE_S, MAX_MEDIAN_DISTANCE_S)
        ticks = away * 10**9 + nanoseconds
        times[known] = (ticks - earliest(ticks)) / TICKS_PER_S_BY_UNIT["ns"]
    return times


def _moments(header: HeaderLine, column: int, kind: str) -> Iterator[tuple[int, int]]:
    """Yield for each row the whole seconds since a fixed midnight in UTC, and the remaining nanoseconds."""
    for number, cell in header.cells_below(column):
        match = MOMENT.fullmatch(cell)
        if match is None and _is_missing(cell):
            yield 0, MISSING_TIME_NS
            continue
        try:
            if match is None:
                raise ValueError(cell)
            day, hour, minute, second, fraction, offset = match.groups()
            seconds = _seconds_to_minute(day, hour, minute, offset) + int(second or 0)
            if int(second or 0) > LEAP_SECOND:
                raise ValueError(second)
        except ValueError:
            problem = f"t is {shown(cell, LONGEST_SHOWN)}, not {kind.partition(' with')[0]}"
            raise TrajectoryError(header.path, problem, DAMAGED_ADVICE, number) from None
        if _kind(match) != kind:
            problem = f"t is {shown(cell, LONGEST_SHOWN)}, not {kind} as before"
            raise TrajectoryError(header.path, problem, DAMAGED_ADVICE, number)
        yield seconds, int((fraction or "").ljust(9, "0"))


@lru_cache(maxsize=1024)
def _seconds_to_minute(day: str | None, hour: str, minute: str, offset: str | None) -> int:
    """Return seconds from a fixed midnight in UTC to the start of a minute. Raises ValueError for an invalid minute."""
    moment = datetime.fromisoformat(f"{day or '2000-01-01'}T{hour:0>2}:{minute}{(offset or 'Z').upper()}")
    return (moment - MIDNIGHT) // timedelta(seconds=1)


def _through_midnights(seconds: np.ndarray) -> np.ndarray:
    """Return clock times (n,) as seconds since the first midnight, across later midnights in both directions."""
    seconds = seconds % DAY_S  # An offset from UTC may lead out of the day.
    steps = np.diff(seconds)
    days = np.cumsum((steps < -DAY_S // 2).astype(np.int64) - (steps > DAY_S // 2))
    # There is no day before the first: a large step up there is a gap.
    days -= np.minimum(np.minimum.accumulate(days), 0)
    return seconds + DAY_S * np.concatenate(([0], days))[: len(seconds)]


def _kind(match: re.Match[str]) -> str:
    """Return the kind of a time, as used in errors."""
    return f"{'a date' if match[1] else CLOCK_TIME} {'with' if match[6] else 'without'} an offset from UTC"


def _is_missing(cell: str) -> bool:
    return cell.lower() in ("", "nan")
