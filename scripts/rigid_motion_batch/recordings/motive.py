"""Motive (OptiTrack) CSV exports, format versions 1.2 to 1.25: the rigid bodies of a take.

The first line holds the settings of the take in pairs. A few rows then say of each column its type (Rigid Body,
Bone, Marker ...), its body's name and ID, what it holds (Rotation, Position, error) and its axis. Empty cells mean
that the body was not tracked and become NaN. Positions stay in the export's Length Units, which
`Trajectory.metres_per_unit` tells. Euler angles (Rotation Type XYZ and the other orders) are degrees about the axes
as the earlier turns left them. Axes are Motive's: right-handed, y up.
Sources: https://docs.optitrack.com/motive/data-export/data-export-csv, and for the angles
https://help.naturalpoint.com/kb/articles/changes-in-motive-s-reported-euler-angles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.command_line import listed

from .euler import quaternions_from_intrinsic_eulers
from .recordings import Selection, Trajectory, TrajectoryError, shown, unique
from .tables import cells_of, lines_of, parse_rows

METRES = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001, "inches": 0.0254, "feet": 0.3048}

ROTATION_TYPES = {"quaternion": "wxyz"} | {"".join(order): "".join(order) for order in permutations("xyz")}
"""Rotation Type to the axes of its columns, in the order of `Poses` or of the turns."""

MOST_HEADER_ROWS = 20
"""Rows after which what is still no sample will not be one. Motive writes about eight."""


@dataclass(frozen=True)
class _Header:
    settings: dict[str, str]
    types: list[str]
    names: list[str]
    ids: list[str]
    contents: list[str]
    axes: list[str]
    line: int
    """The line of the last row of the header."""


def recognises(head: list[str]) -> bool:
    """Return whether the first line begins as Motive's does."""
    return head[0].lstrip('"').startswith("Format Version")


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """Read the rigid bodies of the take."""
    header = _read_header(path)
    metres = METRES[_setting(path, header, "Length Units", "Meters", METRES)]
    usual = "Quaternion" if "w" in header.axes else "XYZ"
    rotation = ROTATION_TYPES[_setting(path, header, "Rotation Type", usual, ROTATION_TYPES)]
    requested = [("position", axis) for axis in "xyz"] + [("rotation", axis) for axis in rotation]
    bodies = _bodies(path, header, requested)
    taken = selection.of(list(bodies))
    columns = {"time": next((index for index, axis in enumerate(header.axes) if axis.startswith("time")), 1)}
    for name in taken:
        columns |= {f"{name} {content} {axis}": bodies[name][content, axis] for content, axis in requested}
    rows = ((number, line) for number, line in lines_of(path, after=header.line) if line.strip(", "))
    numbers = parse_rows(path, rows, ",", columns, max(len(header.axes), len(header.types)))
    trajectories = []
    for name, part in zip(taken, np.split(numbers[:, 1:], len(taken), axis=1), strict=True):
        positions, turns = part[:, :3], part[:, 3:]
        euler = rotation != ROTATION_TYPES["quaternion"]
        quaternions = quaternions_from_intrinsic_eulers(np.radians(turns), rotation.upper()) if euler else turns
        trajectories.append(Trajectory(name, numbers[:, 0], Poses(positions, quaternions), metres))
    return trajectories


def _read_header(path: Path) -> _Header:
    rows: list[list[str]] = []
    last = 0
    for number, line in lines_of(path):
        if not line.strip(", "):
            continue
        cells = cells_of(path, number, line, ",")
        if cells[0].lstrip("-").isdecimal() or len(rows) == MOST_HEADER_ROWS:
            break
        rows.append(cells)
        last = number
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    table = [[cell.lower() for cell in row] for row in rows[1:]]
    kinds = ("rigid body", "marker", "bone")
    typed = next((index for index, row in enumerate(table) if any(cell.startswith(kinds) for cell in row)), None)
    if typed is None or len(table) < typed + 5:
        raise TrajectoryError(
            path, "the rows that say what the columns are end too early", "export with Header Information on", last
        )
    return _Header(settings, table[typed], rows[typed + 2], rows[typed + 3], table[-2], table[-1], last)


def _bodies(path: Path, header: _Header, requested: list[tuple[str, str]]) -> dict[str, dict[tuple[str, str], int]]:
    """Return each rigid body's columns: what it holds and the axis, to the index."""
    result: dict[tuple[str, str], dict[tuple[str, str], int]] = {}
    for index, (kind, name, identity, content, axis) in enumerate(
        zip(header.types, header.names, header.ids, header.contents, header.axes, strict=False)
    ):
        if kind == "rigid body":
            result.setdefault((name, identity), {})[content, axis] = index
    if not result:
        types = dict.fromkeys(cell.title() for cell in header.types if cell not in ("", "type"))
        raise TrajectoryError(path, f"no rigid body, only {listed(list(types))}", "export with Rigid Bodies on")
    for (name, _), columns in result.items():
        missing = [f"{content} {axis.upper()}" for content, axis in requested if (content, axis) not in columns]
        if missing:
            problem = f"{shown(name)} has no column {listed(missing)}"
            raise TrajectoryError(path, problem, "export all columns of the rigid bodies", header.line)
    return dict(zip(unique([name for name, _ in result]), result.values(), strict=True))


def _setting(path: Path, header: _Header, name: str, usual: str, known: Iterable[str]) -> str:
    """Return a setting of the take in lower case, which has to be one of those known."""
    value = header.settings.get(name) or usual
    if value.lower() not in known:
        raise TrajectoryError(path, f"{name} is {shown(value)}", f"export with one of {', '.join(known)}", 1)
    return value.lower()
