"""Dates and clock times in the column of time, exact to the nanosecond, as seconds since the earliest of them.

Dates are those of ISO 8601 in its extended format, with `T` or a blank before the clock time, and with or without an
offset from UTC: `2026-11-22T10:00:00.123456Z`, `2026-11-22 10:00:00+01:00`. A clock time is `10:00:00.123`. A column
is of one kind throughout, which is that of its first time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np

from .options import TICKS
from .recordings import TrajectoryError, shown
from .tables import Table
from .times import earliest
from .vector_cells import is_number

MOMENT = re.compile(
    r"(?:(\d{4}-\d\d-\d\d)[T ])?(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?(?: ?(Z|[+-]\d\d(?::?\d\d)?))?",
    re.ASCII | re.IGNORECASE,
)
"""Day, hour, minute, second, fraction and offset. Java leaves out seconds that are 0, and Python a digit of hours."""

LIKE_A_DATE = re.compile(r"\d[:/]\d|\d[-.]\d\d?[-.]\d|\d{8}T\d", re.ASCII)
"""Pattern of dates as other standards and countries have them."""

CLOCK_TIME = "a clock time"

MIDNIGHT = datetime(1970, 1, 1, tzinfo=UTC)

LEAP_SECOND = 60
"""The last second of some minutes."""

DAY = 86_400
"""Seconds."""

FURTHEST = 2**61 // 10**9
"""Seconds from the median, 73 years. What is further is wild, and counts as so far: the difference of any two times is
then a whole number of nanoseconds that fits 64 bits."""

MISSING = -1
"""Value instead of nanoseconds, where a row has no time."""

LONGEST_SHOWN = 40
"""Characters of a time in an error: as long as any is."""


def kind_of_times(table: Table) -> str | None:
    """Return what the times in column t of a table are, by the first that there is; None for numbers.

    Raises
    ------
    TrajectoryError
        Where it is a date in a way of writing that is not known.
    """
    number, cell = next(((number, cell) for number, cell in table.cells("t") if not _is_missing(cell)), (0, ""))
    if match := MOMENT.fullmatch(cell):
        return _kind(match)
    if LIKE_A_DATE.search(cell) and not is_number(cell):
        problem = f"t is {shown(cell, LONGEST_SHOWN)}, neither a number nor a date that can be read"
        raise TrajectoryError(table.path, problem, "write 2026-11-22T10:00:00.123, 10:00:00.123 or seconds", number)
    return None


def seconds_of_dates(table: Table, kind: str) -> np.ndarray:
    """Return the times in column t of a table.

    Parameters
    ----------
    table : Table
        With rows that are long enough.
    kind : str
        Of all its times.

    Returns
    -------
    array, shape (rows,)
        Seconds since the earliest, wild ones not counted; empty cells are NaN. A clock that falls by more than half a
        day has passed midnight.

    Raises
    ------
    TrajectoryError
        With the number of the line, for what is no such time.
    """
    moments = np.fromiter(_moments(table, kind), np.dtype((np.int64, 2)))
    known = moments[:, 1] != MISSING
    seconds, nanoseconds = moments[known].T
    if kind.startswith(CLOCK_TIME):
        seconds = _through_midnights(seconds)
    times = np.full(len(moments), np.nan)
    if len(seconds):
        away = np.clip(seconds - int(np.median(seconds)), -FURTHEST, FURTHEST)
        ticks = away * 10**9 + nanoseconds
        times[known] = (ticks - earliest(ticks)) / TICKS["ns"]
    return times


def _moments(table: Table, kind: str) -> Iterator[tuple[int, int]]:
    """Yield the seconds of every row since some midnight in UTC, and the nanoseconds besides."""
    way_out = "correct or delete the line"
    for number, cell in table.cells("t"):
        match = MOMENT.fullmatch(cell)
        if match is None and _is_missing(cell):
            yield 0, MISSING
            continue
        try:
            if match is None:
                raise ValueError(cell)
            day, hour, minute, second, fraction, offset = match.groups()
            seconds = _minute(day, hour, minute, offset) + int(second or 0)
            if int(second or 0) > LEAP_SECOND:
                raise ValueError(second)
        except ValueError:
            problem = f"t is {shown(cell, LONGEST_SHOWN)}, not {kind.partition(' with')[0]}"
            raise TrajectoryError(table.path, problem, way_out, number) from None
        if _kind(match) != kind:
            problem = f"t is {shown(cell, LONGEST_SHOWN)}, not {kind} as before"
            raise TrajectoryError(table.path, problem, way_out, number)
        yield seconds, int((fraction or "").ljust(9, "0"))


@lru_cache(maxsize=1024)
def _minute(day: str | None, hour: str, minute: str, offset: str | None) -> int:
    """Return seconds from some midnight in UTC to the beginning of a minute. Raises ValueError for no such minute."""
    moment = datetime.fromisoformat(f"{day or '2000-01-01'}T{hour:0>2}:{minute}{(offset or 'Z').upper()}")
    return (moment - MIDNIGHT) // timedelta(seconds=1)


def _through_midnights(seconds: np.ndarray) -> np.ndarray:
    """Return clock times (n,) as seconds since the first midnight, also those that come back from the next day."""
    seconds = seconds % DAY  # An offset from UTC may lead out of the day.
    steps = np.diff(seconds)
    days = np.cumsum((steps < -DAY // 2).astype(np.int64) - (steps > DAY // 2))
    # Before the first day there is none: what goes up there is a gap.
    days -= np.minimum(np.minimum.accumulate(days), 0)
    return seconds + DAY * np.concatenate(([0], days))[: len(seconds)]


def _kind(match: re.Match[str]) -> str:
    """Return what a time is, as errors call it."""
    return f"{'a date' if match[1] else CLOCK_TIME} {'with' if match[6] else 'without'} an offset from UTC"


def _is_missing(cell: str) -> bool:
    return cell.lower() in ("", "nan")
