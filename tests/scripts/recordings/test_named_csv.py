"""Tests of CSV with named columns."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion_batch.recordings import ReadingOptions, read_trajectories
from rigid_motion_batch.recordings.plausibility import MIN_MIXED_SAMPLES
from tests.thoroughness import tried

HEADER = "t,x,y,z,qx,qy,qz,qw"
ROWS = "0.0,1,2,3,0.1,0.2,0.3,0.9\n0.1,4,5,6,0.4,0.5,0.6,0.4\n"


def test_what_is_broken_in_the_recording_is_kept_for_the_repair(write) -> None:
    text = f"{HEADER}\n5,0,0,0,0,0,0,0\n5,nan,,NaN,0,0,0,-2\n4,inf,0,0,0,0,0,1\n"
    (trajectory,) = read_trajectories(write("take.csv", text)).trajectories
    np.testing.assert_array_equal(trajectory.times, [5, 5, 4])
    np.testing.assert_array_equal(trajectory.poses.quaternions, [[0, 0, 0, 0], [-2, 0, 0, 0], [1, 0, 0, 0]])
    np.testing.assert_array_equal(trajectory.poses.positions[1], [np.nan] * 3)
    assert trajectory.poses.positions[2, 0] == np.inf


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", None, "the file is empty"),
        (f"{HEADER.removesuffix(',qw')}\n{ROWS}", 1, "no column named qw"),
        ("# about\n\nt,x,y,z\n0,1,2,3\n", 3, "positions only, and rotations are needed (found t, x, y, z); record"),
        (f"{HEADER},x\n{ROWS}", 1, "two columns mean x"),
        (f"{HEADER}\n{ROWS}0.2,1,2\n", 4, "3 columns where 8 are needed"),
        (f"{HEADER}\n0,1,2,3,0,0,0,1,5\n{ROWS}", 2, "9 columns where 8 have a name"),
        (f"{HEADER}\n{ROWS}{'9' * 100_000},{'x' * 100_000},2,3,0,0,0,1\n", 4, f"x is '{'x' * 24}...', not a number"),
        (f"{HEADER}\n{ROWS}\x1b[2J,1,2,3,0,0,0,1\n", 4, r"t is '\x1b[2J', not a number"),
        (f"{HEADER}\n{ROWS}".encode() + b"0.2,\xff\xfe,2,3,0,0,0,1\n", 4, "this is not text (byte 0xff)"),
        (f"Recorder v1.2\n\n{HEADER[:-3]}\n0,1,2,3,0.1,0.2,0.3\n", 3, "no column named qw"),
        (f"Recorder v1.2\na,b,c\n{ROWS}", 1, "no column has a known name (found Recorder, v1.2)"),
        (f"Recorder\n{HEADER}\n{ROWS}{HEADER}\n{ROWS}", 2, "lines 2 and 5 both name columns"),
        ("Recorder\n" * 50 + f"{HEADER}\n{ROWS}", 1, "no column has a known name (found Recorder)"),
        (f"Recorder\n{HEADER}\n{ROWS}0.2,1,2,three,0,0,0,1\n", 5, "z is 'three', not a number"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(write, refusal, text: str | bytes, line: int | None, problem: str) -> None:
    told_line, message = refusal(write("take.csv", text))
    assert message.startswith(problem)
    assert told_line == line
    assert len(message) < 200


numbers = st.floats(allow_nan=False, allow_infinity=False)
samples = st.lists(st.tuples(*[numbers] * 9), min_size=2, max_size=MIN_MIXED_SAMPLES - 1).map(np.array)
"""Too few samples for the check that looks for several mixed devices."""


@settings(max_examples=tried(60))
@given(samples, st.permutations(range(9)), st.sampled_from([",", ";", "\t"]))
def test_what_is_written_in_full_precision_comes_back_exactly(tmp_path_factory, table, order, separator):
    path = tmp_path_factory.getbasetemp() / "round_trip.csv"
    names = ["t", "x", "y", "z", "qw", "qx", "qy", "qz", "scale"]
    lines = [[names[column] for column in order], *[[repr(float(row[column])) for column in order] for row in table]]
    Path(path).write_text("\n".join(separator.join(line) for line in lines))
    (trajectory,) = read_trajectories(str(path), ReadingOptions(time_unit="s")).trajectories
    np.testing.assert_array_equal(trajectory.times, table[:, 0])
    np.testing.assert_array_equal(trajectory.poses.positions, table[:, 1:4])
    np.testing.assert_array_equal(trajectory.poses.quaternions, table[:, 4:8])
    if trajectory.poses.scales is None:
        np.testing.assert_array_equal(table[:, 8], 1.0)
    else:
        np.testing.assert_array_equal(trajectory.poses.scales, table[:, 8])


def test_a_scale_that_is_always_1_is_none(write) -> None:
    rows = ROWS.replace("\n", ",1.0\n")
    (trajectory,) = read_trajectories(write("take.csv", f"{HEADER},s\n{rows}")).trajectories
    assert trajectory.poses.scales is None
