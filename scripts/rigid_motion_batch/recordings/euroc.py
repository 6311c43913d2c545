"""EuRoC ground truth: CSV with the header `#timestamp [ns], p_RS_R_x [m], ..., q_RS_w [], q_RS_x [], ...`.

Times are returned in seconds since the first sample. Velocities and biases are ignored.
Source: Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from . import named_csv
from .options import AS_THE_FILE_SAYS
from .recordings import Selection, Trajectory
from .tables import header_lines

NAMES = {
    "timestamp": "t",
    **{f"p_rs_r_{axis}": axis for axis in "xyz"},
    **{f"q_rs_{axis}": f"q{axis}" for axis in "wxyz"},
}
"""Names of the columns, without their units, to what they are called elsewhere."""


def recognises(head: list[str]) -> bool:
    """Return whether the first line is EuRoC's header, and whole."""
    return sorted(filter(None, _names(head[0].lstrip("# ").split(",")))) == sorted(NAMES.values())


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """Read the one body of the file, which has the file's name."""
    header, options = next(header_lines(path)), replace(AS_THE_FILE_SAYS, time_unit="ns")
    header = replace(header, cells=_names(header.cells))
    return named_csv.read_below(selection, options, header, "write a file for each")


def _names(cells: Iterable[str]) -> list[str]:
    return [NAMES.get(cell.partition("[")[0].strip().lower(), "") for cell in cells]
