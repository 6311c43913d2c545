"""TUM trajectories: `timestamp tx ty tz qx qy qz qw` in every line, seconds, separated by white space, `#` comments.

Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats. Where a comment names the columns in another
order, the names are believed.
"""

from __future__ import annotations

from pathlib import Path

from .named_csv import NAMES, OPTIONAL_NAMES
from .recordings import Selection, Trajectory
from .tables import read_table


def recognises(head: list[str]) -> bool:
    """Whether the first row begins with two numbers that only white space separates."""
    rows = (line for line in head if line.strip() and not line.lstrip().startswith("#"))
    try:
        timestamp, tx, *_ = next(rows, "").split()
        float(timestamp), float(tx)
    except ValueError:
        return False
    return True


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """The one body of the file, which has the file's name."""
    (name,) = selection.of([path.stem])
    return [read_table(path, NAMES, OPTIONAL_NAMES, default=tuple(NAMES)).trajectory(name)]
