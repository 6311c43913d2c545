"""Exports of optical motion capture with headers of several rows: Motive (OptiTrack), Vicon and Qualisys.

Motive, format versions 1.2 to 1.25: the first line holds the settings of the take in pairs. A few rows then state for
each column its type (Rigid Body, Bone, Marker ...), the name and ID of its body, its quantity (Rotation, Position,
error) and its axis. Euler angles (Rotation Type XYZ and the other orders) are intrinsic, in degrees. Axes are
right-handed, y up.

Vicon: a line such as `Objects` or `Segments`, the rate, the names of the bodies, the names of the columns, and the
units. Qualisys 6D: lines of a word and its value, among them the rate and the names of the bodies, and the names of the
columns. Both are right-handed, z up. Empty cells were not tracked.
Sources: https://docs.optitrack.com/motive/data-export/data-export-csv,
https://help.naturalpoint.com/kb/articles/changes-in-motive-s-reported-euler-angles,
https://docs.qualisys.com/qtm/content/processing_measurement/rotation_angles_in_qtm.htm,
https://docs.qualisys.com/qtm/content/rotation_appendix/appendix_g_rotation_angle_calculations_in_qtm.htm.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice, permutations, takewhile
from pathlib import Path

import numpy as np

from rigid_motion.motion.quaternions import matrices
from rigid_motion_batch.command_line import listed

from .clips import ClipWarning
from .column_names import ColumnName, column_name
from .euler import quaternions_from_intrinsic_eulers
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError, shown, unique
from .tables import HeaderLine, cells_of, lines_of
from .tracks import read_below

METRES = {"meters": "m", "centimeters": "cm", "millimeters": "mm", "inches": "in", "feet": "ft"}

ROTATION_TYPES = {"quaternion": ""} | {"".join(order): "".join(order).upper() for order in permutations("xyz")}
"""Order of the Euler angles for each Rotation Type."""

MOST_HEADER_ROWS = 20
"""Maximum number of header rows. Motive writes about eight."""

VICON = ("Objects", "Segments", "Trajectories", "Model Outputs", "Joints", "Devices")
"""First lines of Vicon's tables, tables of poses first."""

TRACKED = ("rigid body", "bone")
"""Types of columns that have rotations."""

ROT = tuple(map(str, range(9)))
"""The numbers in the brackets of Qualisys's Rot[0] to Rot[8]."""

AS_ANGLES = 0.01
"""Largest difference between a matrix and that of the angles in the same row, if both state the same rotation."""

EMPTY_CHARACTERS = ' ,;\t"'
"""Characters around the only cell of a row."""

EXPORT_ALONE = "export each body to a file of its own"


def recognises_motive(head: list[str]) -> bool:
    """Return whether the first line begins like Motive's."""
    return head[0].lstrip('"').startswith("Format Version")


def read_motive(path: Path, selection: Selection) -> list[Trajectory]:
    """Read the rigid bodies of the take, or its bones if there are no rigid bodies or a bone is requested."""
    rows, line, separator = _motive_rows(path)
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    unit = METRES[_setting(path, settings, "Length Units", "Meters", METRES)]
    table = [[cell.lower() for cell in row] for row in rows[1:]]
    kinds = ("rigid body", "marker", "bone", "type")
    typed = next((index for index, row in enumerate(table) if any(cell.startswith(kinds) for cell in row)), None)
    if typed is not None and not any(cell not in ("", "type") for cell in table[typed]):
        raise TrajectoryError(path, "no rigid body in this take", "export Rigid Bodies, too", line)
    if typed is None or len(table) < typed + 5:
        problem = "the rows that say what the columns are end too early"
        raise TrajectoryError(path, problem, "export with Header Information on", line)
    types, contents, axes = table[typed], table[-2], table[-1]
    usual = "Quaternion" if "w" in axes else "XYZ"
    euler = ROTATION_TYPES[_setting(path, settings, "Rotation Type", usual, ROTATION_TYPES)]
    columns = list(zip(types, rows[typed + 2], rows[typed + 3], contents, axes, strict=False))
    labels = {kind: _labels((name, number) for cell, name, number, *_ in columns if cell == kind) for kind in TRACKED}
    rigid, bones = labels.values()
    kind = TRACKED[not rigid or (selection.requested in bones.values() and selection.requested not in rigid.values())]
    if not labels[kind]:
        found = listed(list(dict.fromkeys(cell.title() for cell in types if cell not in ("", "type"))))
        raise TrajectoryError(path, f"no rigid body, only {found}", "export with Rigid Bodies on")
    names: list[ColumnName | None] = [None] * max(len(axes), len(types))
    for place, (cell, name, number, content, axis) in enumerate(columns):
        if cell == kind and content in ("position", "rotation") and axis:
            of_unit = unit if content == "position" else "deg" if euler else ""
            names[place] = ColumnName(content, axis, of_unit, labels[kind][name, number])
    names[next((place for place, axis in enumerate(axes) if axis.startswith("time")), 1)] = ColumnName("time", unit="s")
    advice = f"export all columns of the {'bones' if kind == 'bone' else 'rigid bodies'}"
    warnings: tuple[ClipWarning, ...] = ()
    if settings.get("Coordinate Space", "Global").lower() != "global":
        warnings = (ClipWarning("its poses are in the space of a parent", "export with Coordinate Space: Global"),)
    cells = [*rows[-1], *[""] * (len(names) - len(axes))]
    header = HeaderLine(path, line, separator, cells, names=names, advice=advice, warnings=warnings)
    return read_below(selection, replace(AS_THE_FILE_SAYS, euler=euler or None), header, EXPORT_ALONE)


def _labels(bodies: Iterable[tuple[str, str]]) -> dict[tuple[str, str], str]:
    """Return unique names of bodies, keyed by their name and number in the file."""
    keys = list(dict.fromkeys(bodies))
    return dict(zip(keys, unique([name for name, _ in keys]), strict=True))


def _motive_rows(path: Path) -> tuple[list[list[str]], int, str]:
    """Return the rows of a header, the number of the last line, and the separator of the cells."""
    rows: list[list[str]] = []
    last, separator = 0, ","
    for number, line in lines_of(path):
        if not rows:
            separator = max(",;\t", key=line.count)
        if not line.strip(f"{separator} "):
            continue
        cells = cells_of(path, number, line, separator)
        if cells[0].lstrip("-").isdecimal() or len(rows) == MOST_HEADER_ROWS:
            break
        rows.append(cells)
        last = number
    return rows, last, separator


def _setting(path: Path, settings: dict[str, str], name: str, usual: str, known: Iterable[str]) -> str:
    """Return a setting of the take in lower case, which has to be a known one."""
    value = settings.get(name) or usual
    if value.lower() not in known:
        raise TrajectoryError(path, f"{name} is {shown(value)}", f"export with one of {', '.join(known)}", 1)
    return value.lower()


def recognises_vicon(head: list[str]) -> bool:
    """Return whether the first two lines are the title of a Vicon table and its rate."""
    first, second = ((*(line.strip(' ,;\t"') for line in head[:2]), "", ""))[:2]
    return first in VICON and second.replace(".", "", 1).isdecimal()


def read_vicon(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the objects or segments of the first table that has any."""
    title = next((number for number, line in lines_of(path) if line.strip(EMPTY_CHARACTERS) in VICON[:2]), None)
    rows = [] if title is None else list(islice(lines_of(path, after=title), 3))
    if len(rows) < 3:
        raise TrajectoryError(path, "no table of Objects or Segments in it", "export these from Vicon, with the header")
    (rate_line, rate), (labels_line, labels), (names_line, text) = rows
    header = HeaderLine.of(path, names_line, text).of_rows()
    bodies = cells_of(path, labels_line, labels, header.separator)
    names: list[ColumnName | None] = []
    label = ""
    for place, cell in enumerate(header.cells):
        label = (bodies[place] if place < len(bodies) else "").removeprefix("Global Angle ") or label
        name = column_name(cell)
        names.append(name and replace(name, body=label if place > 1 else ""))
    if not options.frame_rate and not options.time_unit:
        options = replace(options, frame_rate=_rate(path, rate.strip(EMPTY_CHARACTERS), rate_line))
    return read_below(selection, options, replace(header, names=names, rows_of=_until_blank), EXPORT_ALONE)


def _until_blank(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Return the rows of a table up to a blank line, after which other tables may follow."""
    return takewhile(lambda row: bool(row[1].strip(EMPTY_CHARACTERS)), lines)


def _rate(path: Path, text: str, line: int) -> float:
    try:
        return ReadingOptions(frame_rate=float(text)).frame_rate or 1.0
    except ValueError:
        raise TrajectoryError(path, f"the rate is {shown(text)}", "say it: --frame-rate 100", line) from None


def recognises_qualisys(head: list[str]) -> bool:
    """Return whether the first lines are those of a 6D data file."""
    return head[0].startswith(("NO_OF_FRAMES", "FILE_VERSION")) and any(
        line.startswith("NO_OF_BOD") for line in head[:20]
    )


def read_qualisys(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the bodies of a 6D data file."""
    settings: dict[str, list[str]] = {}
    for number, line in islice(lines_of(path), 2 * MOST_HEADER_ROWS):
        cells = cells_of(path, number, line, "\t")
        if {"X", "Y", "Z"} <= {*cells}:
            break
        settings[cells[0] if cells else ""] = cells[1:]
    else:
        raise TrajectoryError(path, "no line names the columns X, Y, Z", "export 6D data with Include TSV header on")
    bodies = [name for name in settings.get("BODY_NAMES", []) if name] or [path.stem]
    names: list[ColumnName | None] = []
    body = -1
    for cell in cells:
        body += cell == "X"
        name = column_name(cell)
        label = bodies[body] if 0 <= body < len(bodies) else ""
        unit = "mm" if name and name.kind == "position" else "deg" if name and name.kind == "euler" else ""
        names.append(name and replace(name, body=label, unit=unit) if body >= 0 else name)
    if all(name is None or name.kind != "time" for name in names) and not (options.frame_rate or options.time_unit):
        options = replace(options, frame_rate=_rate(path, (settings.get("FREQUENCY") or [""])[0], 1))
    return read_below(
        selection, options, _with_matrix_order(HeaderLine(path, number, "\t", cells, names=names), names), EXPORT_ALONE
    )


def _with_matrix_order(header: HeaderLine, names: Sequence[ColumnName | None]) -> HeaderLine:
    """Return a header in which Rot[0] to Rot[8] go down the columns of the matrix, unless the angles show otherwise.

    By default, the angles are intrinsic turns about x, y and z in this order. If the user of Qualisys chose other
    angles, or exported none, nothing shows the order of the matrix, which is a warning.
    """
    wanted = ("roll", "pitch", "yaw", *ROT)
    axes = [name.axis if name and name.kind in ("euler", "rotation") else "" for name in names]
    sure = not {*ROT} <= {*axes}
    if {*wanted} <= {*axes}:
        columns = {axis: axes.index(axis) for axis in wanted}
        numbers = header.numbers_below(columns)
        turns = matrices(quaternions_from_intrinsic_eulers(np.radians(numbers[:, :3]), "XYZ"))
        by_rows, by_columns = (
            np.count_nonzero(np.abs(one.reshape(9, -1).T - numbers[:, 3:]).max(axis=1) < AS_ANGLES) > len(numbers) / 2
            for one in (turns, turns.swapaxes(0, 1))
        )
        if by_rows:
            return header
        sure = bool(by_columns)
    flipped = {axis: str(3 * (place % 3) + place // 3) for place, axis in enumerate(ROT)}
    names = [
        replace(name, axis=flipped[axis]) if name and axis in flipped else name
        for name, axis in zip(names, axes, strict=True)
    ]
    text = "no angles tell how Rot[0] to Rot[8] go, and they are taken to go down the columns of the matrix"
    way_out = "export Roll, Pitch and Yaw as Qualisys defines them beside"
    return replace(header, names=names, warnings=() if sure else (ClipWarning(text, way_out),))
