"""TUM trajectories: `timestamp tx ty tz qx qy qz qw` in every line, seconds, separated by white space, `#` comments.

Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats. Where a comment names the columns in another
order, the names are believed.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from .options import ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError
from .sense import require_one_body
from .tables import read_table
from .times import require_seconds, seconds_of

NAMES = {
    "t": ("t", "time", "timestamp"),
    "x": ("x", "tx"),
    "y": ("y", "ty"),
    "z": ("z", "tz"),
    "qx": ("qx",),
    "qy": ("qy",),
    "qz": ("qz",),
    "qw": ("qw",),
}
OPTIONAL_NAMES = {"scale": ("s", "scale")}


def recognises(head: list[str]) -> bool:
    """Whether the first row begins with two numbers that only white space separates."""
    rows = (line for line in head if line.strip() and not line.lstrip().startswith("#"))
    try:
        timestamp, tx, *_ = next(rows, "").split()
        float(timestamp), float(tx)
    except ValueError:
        return False
    return True


def read(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """The one body of the file, which has the file's name."""
    (name,) = selection.of([path.stem])
    table = read_table(path, NAMES, OPTIONAL_NAMES, default=tuple(NAMES))
    line, row = next(table.rows(), (0, ""))
    if len(row.split()) == 4:
        problem = "positions only, and rotations are needed"
        raise TrajectoryError(path, problem, "write t x y z qx qy qz qw in every line", line)
    trajectory, unit = table.trajectory(name), options.time_unit or ""
    if options.frame_rate:
        trajectory = replace(trajectory, times=trajectory.times / options.frame_rate)
    else:
        require_seconds(table, trajectory.times, unit)
        trajectory = replace(trajectory, times=seconds_of(table, trajectory.times, unit))
    require_one_body(trajectory, path, "write a file for each", table.header + 1)
    return [trajectory]
