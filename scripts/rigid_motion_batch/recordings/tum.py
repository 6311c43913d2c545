"""TUM trajectories: `timestamp tx ty tz qx qy qz qw` in every line, seconds, separated by white space, `#` comments.

Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats. Where a comment names the columns in another
order, the names are used.
"""

from __future__ import annotations

from pathlib import Path

from . import named_csv
from .columns import known_in, layout_of
from .options import ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError
from .tables import HeaderLine, Table, header_lines

NAMES = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"]


def recognises(head: list[str]) -> bool:
    """Return whether the first row begins with two numbers that only white space separates."""
    rows = (line for line in head if line.strip() and not line.lstrip().startswith("#"))
    try:
        timestamp, tx, *_ = next(rows, "").split()
        float(timestamp), float(tx)
    except ValueError:
        return False
    return True


def read(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the one body of the file, which has the file's name."""
    header = _header(path, options)
    line, row = next(Table(header, {}).rows(), (0, ""))
    if len(row.split()) == 4:
        problem = "positions only, and rotations are needed"
        raise TrajectoryError(path, problem, "write t x y z qx qy qz qw in every line", line)
    return named_csv.read_below(selection, options, header, "write a file for each")


def _header(path: Path, options: ReadingOptions) -> HeaderLine:
    """Return the line that names the columns, or one before the first row with the usual names."""
    for line in header_lines(path):
        try:
            layout_of(line, options)
            return line
        except TrajectoryError as problem:
            last = problem
    if known_in(line):
        raise last
    return HeaderLine(path, line.number - 1, None, NAMES)
