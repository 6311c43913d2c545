"""EuRoC ground truth: CSV with the header `#timestamp [ns], p_RS_R_x [m], ..., q_RS_w [], q_RS_x [], ...`.

Times are returned in seconds since the first sample. The file's nanoseconds since 1970 are more than a float64 can
hold (its steps there are 240 ns), so they are subtracted as integers first. Velocities and biases are ignored.
Source: Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses

from .recordings import Selection, Trajectory, TrajectoryError
from .tables import header_lines

NAMES = {
    "t": "timestamp",
    "x": "p_rs_r_x",
    "y": "p_rs_r_y",
    "z": "p_rs_r_z",
    "qw": "q_rs_w",
    "qx": "q_rs_x",
    "qy": "q_rs_y",
    "qz": "q_rs_z",
}


def recognises(head: list[str]) -> bool:
    """Whether the first line is EuRoC's header."""
    return head[0].lower().replace(" ", "").startswith("#timestamp[ns]") or "p_rs_r_x" in head[0].lower()


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """The one body of the file, which has the file's name."""
    (name,) = selection.of([path.stem])
    header = next(header_lines(path))
    names = [cell.partition("[")[0].strip().lower() for cell in header.cells]
    if missing := [column for column in NAMES.values() if column not in names]:
        way_out = f"the header has to name {', '.join(NAMES.values())}"
        raise TrajectoryError(path, f"no column named {', '.join(missing)}", way_out, header.number)
    if repeated := [meaning for meaning, column in NAMES.items() if names.count(column) > 1]:
        problem = f"two columns mean {repeated[0]}"
        raise TrajectoryError(path, problem, "rename or delete one of them", header.number)
    table = header.table(path, {meaning: names.index(column) for meaning, column in NAMES.items()})
    numbers = table.parse(list(NAMES))
    nanoseconds = table.parse(["t"], np.int64)[:, 0]
    return [Trajectory(name, (nanoseconds - nanoseconds[:1]) * 1e-9, Poses(numbers[:, 1:4], numbers[:, 4:8]))]
