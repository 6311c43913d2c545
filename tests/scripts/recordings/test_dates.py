"""Tests of dates and clock times in the time column."""

from collections.abc import Sequence

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories

POSE = "1,2,3,0,0,0,1"


def log(times: Sequence[str], name: str = "time") -> str:
    return f"{name},x,y,z,qx,qy,qz,qw\n" + "".join(f"{time},{POSE}\n" for time in times)


def times_of(source: str) -> np.ndarray:
    (trajectory,) = read_trajectories(source).trajectories
    return trajectory.times


@pytest.mark.parametrize(
    "times",
    [
        ["2026-11-22T10:00:00.123456789Z", "2026-11-22T10:00:00.373456789Z"],
        ["2026-11-22 23:59:59.9", "2026-11-23 00:00:00.15"],
        ['"2026-11-22 10:00:00.000001"', "2026-11-22 10:00:00.250001"],
        ["0001-01-01T00:00:00", "0001-01-01T00:00:00.25"],
        ["2026-10-25T02:59:59.9+02:00", "2026-10-25T02:00:00.15+01:00"],
        ["2026-10-25T02:59:59.9+0200", "2026-10-25T01:00:00.15Z"],
        ["2026-11-22 06:30:00 -0330", "2026-11-22 10:00:00.25Z"],
        ["2016-12-31T23:59:60Z", "2017-01-01T00:00:00.25Z"],
        ["10:00:00.123", "10:00:00.373"],
        ["23:59:59.9", "00:00:00.15"],
        ["00:30:00+01:00", "23:30:00.25Z"],
    ],
)
def test_dates_and_clock_times_are_seconds_from_the_first(write, times: list[str]) -> None:
    np.testing.assert_array_equal(times_of(write("log.csv", log(times))), [0.0, 0.25])


def test_a_clock_that_comes_back_from_the_next_day_is_of_the_day_before(write) -> None:
    times = ["23:59:59.5", "00:00:00", "23:59:59.75", "00:00:00.25"]
    np.testing.assert_array_equal(times_of(write("log.csv", log(times))), [0.0, 0.5, 0.25, 0.75])


def test_a_row_without_a_time_is_kept_for_the_repair(write) -> None:
    times = times_of(write("log.csv", log(["10:00:00", "", "NaN", "10:00:00.25"])))
    np.testing.assert_array_equal(times, [0.0, np.nan, np.nan, 0.25])


@pytest.mark.parametrize(
    ("second", "problem"),
    [
        ("2026-13-22T10:00:00", "t is '2026-13-22T10:00:00', not a date; delete this line if it is damaged"),
        ("2026-11-22T10:00:61", "t is '2026-11-22T10:00:61', not a date"),
        ("2026-11-22T10:00:00.1234567891", "t is '2026-11-22T10:00:00.1234567891', not a date"),
        ("2026-11-22T10:00:00\u0661", "t is '2026-11-22T10:00:00\u0661', not a date"),
        ("2026-11-22T10:00:00+25:00", "t is '2026-11-22T10:00:00+25:00', not a date"),
        ("2026-11-22T10:00:00Z", "t is '2026-11-22T10:00:00Z', not a date without an offset from UTC as before"),
    ],
)
def test_a_damaged_date_is_told_with_its_line(write, refusal, second: str, problem: str) -> None:
    line, message = refusal(write("log.csv", log(["2026-11-22T10:00:00", second])))
    assert line == 3
    assert message.startswith(problem)


@pytest.mark.parametrize("time", ["11/22/2026 10:00:00", "22.11.2026 10:00", "2026-11-22", "20261122T100000"])
def test_a_date_in_another_standard_is_answered_with_the_one_that_is_read(write, refusal, time: str) -> None:
    line, message = refusal(write("log.csv", log([time, time])))
    assert line == 2
    assert message == (
        f"t is '{time}', neither a number nor a date that can be read; "
        "write 2026-11-22T10:00:00.123, 10:00:00.123 or seconds"
    )


def test_a_unit_of_time_is_nothing_to_dates(write, refusal) -> None:
    _, message = refusal(write("log.csv", log(["10:00:00Z", "10:00:01Z"])), time_unit="ms")
    assert message == (
        "--time-unit ms is for times that are numbers, and these have a clock time with an offset from UTC; "
        "leave it out"
    )
