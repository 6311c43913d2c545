"""CSV with named columns in any order: `t,x,y,z,qx,qy,qz,qw` and, for a body that grows or shrinks, `scale`.

The quaternion's order is that of the names. Columns with other names are ignored, the case of the names is too.
Separated by commas, semicolons or tabs; with the latter two, numbers may have a decimal comma. The program's own
files (`t,x,y,z,qw,qx,qy,qz`) are such CSVs.
"""

from __future__ import annotations

from pathlib import Path

from .recordings import Selection, Trajectory
from .tables import read_table

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


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """The one body of the file, which has the file's name."""
    (name,) = selection.of([path.stem])
    return [read_table(path, NAMES, OPTIONAL_NAMES).trajectory(name)]
