"""The clock of a body, chosen among all time columns of a file.

Trackers write the time of the device, of the computer and of the day, and one of them may stand still for a hundred
rows. The clock with the most steps forward is taken; among several of these, the steadiest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigid_motion_batch.command_line import listed

from .columns import RowLayout, require_time_unit
from .options import TICKS_PER_S_BY_UNIT, ReadingOptions
from .recordings import TrajectoryError, shown
from .tables import HeaderLine
from .times import kind_of_times, seconds_of, seconds_of_dates, unit_by_rate, whole_ticks

NEARLY_ALL = 0.99
"""Clocks with at least this fraction of the largest number of steps forward count as equally good."""

LONGEST_SHOWN = 60
"""Characters shown of a column's name."""

SAME_RATE = 0.01
"""Ratio by which the lengths of two clocks may differ that run at the same speed."""


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of all rows of a file, from one column or two."""

    name: str
    seconds: np.ndarray
    """Shape (rows,)."""

    remark: str = ""
    dated: bool = False
    """True if the times are dates or clock times."""

    unit: str = ""
    """The unit that the file or the user states."""

    ticks: np.ndarray = field(default_factory=lambda: np.empty(0))
    """The numbers in the file."""

    per_second: float = 0.0
    """Number of ticks per second; 0 if the times are not numbers in a single column."""


def clock_of(
    header: HeaderLine,
    columns: Sequence[int],
    layout: RowLayout,
    options: ReadingOptions,
    count: int,
    body: np.ndarray | slice,
) -> Clock:
    """Return the clock for the rows of a body, chosen from the columns that may be the time; `count` is all rows of the
    file.

    Without such columns, rows are counted. Raises TrajectoryError if equally good clocks disagree, or none can be read.
    """
    if not columns:
        return Clock("", np.arange(count) / (options.frame_rate or 1.0))
    if len(columns) == 1:
        return _clock(header, columns[0], layout, options, body)
    clocks: list[Clock] = []
    errors: list[TrajectoryError] = []
    for column in columns:
        try:
            clocks.append(_clock(header, column, layout, options, body))
        except TrajectoryError as error:
            errors.append(error)
    clocks = _with_nanoseconds(clocks)
    if not clocks:
        raise errors[0]
    steps = [np.diff(clock.seconds[body]) for clock in clocks]
    forward = [int(np.count_nonzero(some > 0.0)) for some in steps]
    best = [place for place, many in enumerate(forward) if many >= NEARLY_ALL * max(forward)]
    chosen = min(best, key=lambda place: _step_variation(steps[place]))
    lengths = {clocks[place].name: _length(clocks[place].seconds[body]) for place in best}
    if max(lengths.values()) > (1.0 + SAME_RATE) * min(lengths.values()):
        both = listed([f"{shown(name)} lasts {length:.4g} s" for name, length in lengths.items()], 3)
        raise header.error(f"two columns mean t and disagree ({both})", "say which with --columns t=NAME")
    result = clocks[chosen]
    others = listed([shown(clock.name, LONGEST_SHOWN) for clock in clocks if clock is not result], 3)
    if not others:
        return result
    said = f"times are those of {shown(result.name, LONGEST_SHOWN)} and not of {others}"
    if len(best) < len(clocks):
        said += f": of {count} rows the time changes in {forward[chosen]}, and not in {min(forward)}"
    return replace(result, remark="; ".join(filter(None, (said, result.remark))))


def _clock(
    header: HeaderLine, column: int, layout: RowLayout, options: ReadingOptions, body: np.ndarray | slice
) -> Clock:
    """Return the times of one column."""
    name, kind = header.cells[column], kind_of_times(header, column)
    if kind and (options.time_unit or options.frame_rate):
        given = f"--time-unit {options.time_unit}" if options.time_unit else f"--frame-rate {options.frame_rate:g}"
        problem = f"{given} is for times that are numbers, and these have {kind}"
        raise header.error(problem, "leave it out")
    if kind:
        return Clock(name, seconds_of_dates(header, column, kind), dated=True)
    ticks = whole_ticks(header, column)
    if options.frame_rate:
        return Clock(name, (ticks if ticks.dtype == float else ticks - ticks.min()) / options.frame_rate)
    unit, remark = options.time_unit or layout.units.get(column, ""), ""
    require_time_unit(header, unit)
    guessed = ""
    if not unit:
        guessed, remark = unit_by_rate(header, ticks[body])
    per_second = TICKS_PER_S_BY_UNIT[unit or guessed or "s"]
    return Clock(name, seconds_of(ticks, per_second), remark, unit=unit, ticks=ticks, per_second=per_second)


def _with_nanoseconds(clocks: list[Clock]) -> list[Clock]:
    """Return the clocks, joining each pair of a column of seconds and the next column of their nanoseconds."""
    result: list[Clock] = []
    for clock in clocks:
        before = result[-1] if result else clock
        counted = (before.unit, clock.unit) == ("s", "ns") and bool(np.all(np.rint(before.ticks) == before.ticks))
        if counted and np.all((clock.ticks >= 0) & (clock.ticks < TICKS_PER_S_BY_UNIT["ns"])):
            seconds = (before.ticks - before.ticks.min()) + clock.ticks / TICKS_PER_S_BY_UNIT["ns"]
            result[-1] = Clock(f"{before.name} and {clock.name}", seconds)
            continue
        result.append(clock)
    return result


def _length(seconds: np.ndarray) -> float:
    """Return the seconds from the 5th to the 95th percentile of a clock, which ignores outliers."""
    known = seconds[np.isfinite(seconds)]
    return float(np.subtract(*np.percentile(known, (95.0, 5.0)))) if len(known) else 0.0


def _step_variation(steps: np.ndarray) -> float:
    """Return the median deviation of the steps from the median step, as a fraction of it, rounded to percents."""
    steps = steps[steps > 0.0]
    usual = np.median(steps) if len(steps) else 1.0
    return round(float(np.median(np.abs(steps - usual)) / usual), 2) if len(steps) else np.inf
