"""Columns of a header: the time, position and rotation of each body, or an error that says what is missing.

A row may hold several bodies, each with its own name in front of its columns (`left_x`, `right_x`), or one of several
bodies, named in another column (`device`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rigid_motion_batch.command_line import listed

from .column_names import DEVICES, METRES, TURNS, ColumnName, column_name, unit_in
from .options import TICKS_PER_S_BY_UNIT, ReadingOptions
from .recordings import NoMotion, TrajectoryError, shown
from .tables import HeaderLine, is_number

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
EULER = ("rx", "ry", "rz")
MATRIX = ("m00", "m01", "m02", "m10", "m11", "m12", "m20", "m21", "m22")
BOTTOM = ("m30", "m31", "m32")
"""The fourth row of a matrix: the translation, if the matrix is transposed."""

OPTIONAL = ("scale", *BOTTOM)

KNOWN_NAMES = "t, time, timestamp_ms; x, px, pos_x, position.x; qw, rot_w, rotation.w"
"""Known names, for the text of an error."""

MOST_FOUND = 12
"""Number of columns that an error lists."""

MOST_REMARKS = 3
"""Number of bodies listed as left out."""

NOT_POSES = {"v", "vel", "velocity", "linear", "angular", "acc", "accel", "acceleration", "gyro", "omega", "b", "bias"}
"""First words of column names that look like positions but are not."""


@dataclass(frozen=True)
class RowLayout:
    """Layout of a row: the column index of each value."""

    times: tuple[int, ...]
    """Columns that may be the time; empty if the rows are counted instead."""

    bodies: Mapping[str, Mapping[str, int]]
    """The columns of each body by its name, which is empty for columns without a prefix: `POSITION`, then `QUATERNION`,
    `MATRIX` or `EULER`, possibly some of `OPTIONAL`, and t if the body has its own clock."""

    units: Mapping[int, str]
    """Units of the columns that state one: a name in `TICKS_PER_S_BY_UNIT` or `column_names.METRES`, "deg", "rad", or
    an unknown one."""

    devices: tuple[int, ...] = ()
    """Columns that may tell whose row it is, the most likely first."""

    remark: str = ""
    """Remarks on columns that look like a body but are left out, and on guesses."""


Found = dict[str, list[int]]
"""Meanings of the columns of a body, each with the indices of all columns whose names fit."""


def layout_of(header: HeaderLine, options: ReadingOptions) -> RowLayout:
    """Return the meanings of the columns of a header.

    Raises
    ------
    TrajectoryError
        If columns are missing or ambiguous.
    """
    cells, names = header.cells, names_of(header)
    explicit = _explicit(header, options)
    of_kind = {
        kind: [
            index for index, name in enumerate(names) if name and name.kind == kind and index not in explicit.values()
        ]
        for kind in ("time", "frame", "device")
    }
    bodies = _bodies(names, set(explicit.values()))
    rotations = (EULER,) if options.euler else (QUATERNION, MATRIX)
    whole: dict[str, tuple[str, ...]] = {}
    for label, result in bodies.items():
        for rotation in rotations:
            if {*result, *explicit} >= {*POSITION, *rotation}:
                whole.setdefault(label, (*POSITION, *rotation))
    needed = (*POSITION, *rotations[0])
    if explicit.keys() >= set(needed):
        bodies, whole = {"": {}}, {"": needed}
    for index, label, name in _own_clocks(header, names, whole):
        bodies[label].setdefault("t", []).append(index)
        names[index] = name
    # A date in addition to a count of seconds is redundant.
    axes = [name.axis if name else "" for name in names]
    times = [index for index in of_kind["time"] if axes[index] != "date"] or of_kind["time"]
    times = (options.frame_rate and of_kind["frame"]) or times
    times = [explicit["t"]] if "t" in explicit else times
    timed = bool(times or options.frame_rate) or (bool(whole) and all("t" in bodies[label] for label in whole))
    if whole and not timed and (of_kind["frame"] or header.names):
        frames = [shown(cells[index]) for index in of_kind["frame"][:1]]
        problem = f"no column of time, only one that counts frames ({frames[0]})" if frames else "poses without times"
        raise header.error(problem, "say how many frames a second it has: --frame-rate 90")
    if not timed or not whole:
        raise _missing_error(header, names, bodies, bool(times), needed, explicit)

    def only(meaning: str, indices: Sequence[int]) -> int:
        if len(indices) == 1:
            return indices[0]
        both = listed(list(dict.fromkeys(shown(cells[index]) for index in indices)), limit=3)
        way_out = f"say which with --columns {meaning}=NAME, or rename or delete one of them"
        raise header.error(f"two columns mean {meaning} ({both})", way_out)

    where = {}
    for label, meant in whole.items():
        columns = bodies[label] | {meaning: [index] for meaning, index in explicit.items()}
        where[label] = {item: only(item, columns[item]) for item in (*meant, *OPTIONAL, "t") if item in columns}
    units = {index: name.unit for index, name in enumerate(names) if name and name.unit}
    units |= {index: unit for index in explicit.values() if (unit := unit_in(cells[index]))}
    devices = sorted(of_kind["device"], key=lambda index: DEVICES.index(axes[index]))
    devices = [explicit["device"]] if "device" in explicit else devices
    remarks = [
        text for label, result in bodies.items() if label not in whole and (text := _missing_parts(label, result))
    ]
    numbered = [columns["qw"] for columns in where.values() if "qw" in columns and axes[columns["qw"]].isdecimal()]
    remarks += [f"{shown(cells[index])} is taken for w" for index in numbered[:1]]
    return RowLayout(tuple(times), where, units, tuple(devices), "; ".join(remarks[-MOST_REMARKS:]))


def names_of(header: HeaderLine) -> list[ColumnName | None]:
    """Return the meanings of the header's column names, spelling the name of each body in the same case."""
    if header.names is not None:
        return list(header.names)
    labels: dict[str, str] = {}
    names = [column_name(cell) for cell in header.cells]
    return [name and replace(name, body=labels.setdefault(name.body.lower(), name.body)) for name in names]


def _explicit(header: HeaderLine, options: ReadingOptions) -> dict[str, int]:
    """Return the columns that the user named."""
    written = [cell.lower() for cell in header.cells]
    explicit = {}
    for meaning, column in options.columns:
        requested = column.strip().lower()
        if requested not in written:
            way_out = f"--columns {meaning}=NAME takes one of {columns_found(header.cells)}"
            raise header.error(f"no column is named {shown(column)}", way_out)
        explicit[meaning] = written.index(requested)
    return explicit


def _bodies(names: Sequence[ColumnName | None], explicit: set[int]) -> dict[str, Found]:
    """Return the columns of positions, rotations and scales, by the prefix that names the body."""
    bodies: dict[str, Found] = {"": {}}
    numbered: dict[tuple[str, str], Found] = {}
    with_w = {name.body for name in names if name and name.kind == "rotation" and name.axis == "w"}
    for index, name in enumerate(names):
        if name is None or name.kind in ("time", "frame", "device") or index in explicit:
            continue
        found = bodies.setdefault(name.body, {})
        if name.axis.isdecimal():
            numbered.setdefault((name.body, name.kind), {}).setdefault(name.axis, []).append(index)
            continue
        if name.kind == "scale" or name.kind == "position" or name.axis in TURNS:
            meaning = name.axis or "scale"
        else:
            meaning = f"{'q' if name.kind == 'quaternion' or name.body in with_w else 'r'}{name.axis}"
        found.setdefault(meaning, []).append(index)
    for (body, kind), found in numbered.items():
        for meaning, axis in _numbered(kind, [*found]):
            bodies[body].setdefault(meaning, []).extend(found[axis])
    _join_halves(bodies, names)
    return bodies


def _numbered(kind: str, axes: list[str]) -> Iterator[tuple[str, str]]:
    """Yield pairs of a meaning and the number that stands for an axis; nothing if the count of numbers does not fit."""
    numbers = sorted(map(int, axes))
    count, base = len(axes), numbers[0]
    if count >= len(MATRIX) and all(len(axis) == 2 for axis in axes):
        places = [(int(axis[0]) - base // 10, int(axis[1]) - base // 10) for axis in axes]
    elif count in (9, 12, 16) and numbers == list(range(count)):
        places = [divmod(int(axis), 3 if count == 9 else 4) for axis in axes]
    elif (
        numbers == list(range(base, base + count))
        and base < 2
        and (count, kind == "position") in ((3, True), (4, False))
    ):
        # q0 to q3 have w first, as in aviation, and q1 to q4 have it last, as in spaceflight.
        order = "xyz" if count == 3 else "wxyz" if kind == "quaternion" and base == 0 else "xyzw"
        yield from (("q" * (count == 4) + order[int(axis) - base], axis) for axis in axes)
        return
    else:
        return
    for axis, (row, column) in zip(axes, places, strict=True):
        if column < 3 and row < 4:
            yield f"m{row}{column}", axis
        elif column == 3 and row < 3:
            yield "xyz"[row], axis


def _join_halves(bodies: dict[str, Found], names: Sequence[ColumnName | None]) -> None:
    """Merge a position and a rotation between different frames into one body, as in p_RS_R_x and q_RS_w."""
    units = {index: name.unit for index, name in enumerate(names) if name}
    halves: dict[bool, list[str]] = {True: [], False: []}
    for label, found in bodies.items():
        turned = any({*rotation} <= {*found} for rotation in (QUATERNION, MATRIX))
        placed = {*POSITION} <= {*found} and all(units[found[axis][0]] in ("", *METRES) for axis in POSITION)
        if turned != placed and re.split(r"[\W_]", label.lower())[0] not in NOT_POSES:
            halves[turned].append(label)
    if len(halves[True]) == len(halves[False]) == 1 and not bodies[""]:
        turned_label, placed_label = halves[True][0], halves[False][0]
        if placed_label.startswith(turned_label) or turned_label.startswith(placed_label):
            bodies[""] = bodies.pop(placed_label) | bodies.pop(turned_label)


def _own_clocks(
    header: HeaderLine, names: Sequence[ColumnName | None], labels: Mapping[str, object]
) -> Iterator[tuple[int, str, ColumnName]]:
    """Yield the columns whose names mean a time once the name of a body is removed."""
    for index, cell in enumerate(header.cells):
        for label in labels if names[index] is None and header.names is None else ():
            rest = re.sub(rf"(^|[\W_]){re.escape(label)}([\W_]|$)", " ", cell, flags=re.IGNORECASE) if label else cell
            if rest != cell and (name := column_name(rest)) and name.kind == "time":
                yield index, label, name


def known_in(header: HeaderLine) -> int:
    """Return the number of columns with a known meaning, which is highest in the likeliest header line."""
    return sum(name is not None for name in names_of(header))


def _missing_parts(label: str, found: Found) -> str:
    """Return what a nearly complete body lacks; empty if it need not be a body."""
    least = min(({*POSITION, *rotation} - {*found} for rotation in (QUATERNION, EULER)), key=len)
    if len(least) > 2 or not label:
        return ""
    lacks = f"it has no column {', '.join(sorted(least))}" if least else "its rotations are Euler angles, for --euler"
    return f"{shown(label)} is left out, as {lacks}"


def _missing_error(
    header: HeaderLine,
    names: Sequence[ColumnName | None],
    bodies: Mapping[str, Found],
    timed: bool,
    needed: Sequence[str],
    explicit: Mapping[str, int],
) -> TrajectoryError:
    """Return the error for a header without a complete body: it names what the most complete body lacks."""
    cells = header.cells
    label, nearest = max(bodies.items(), key=lambda body: sum(item in body[1] for item in needed))
    if not nearest.keys() >= set(POSITION) and header.names is None:
        # The name of some other column ends like an axis by chance.
        label, nearest = "", bodies[""]
    missing = [item for item in ("t", *needed) if item not in explicit and item not in nearest]
    if timed:
        missing.remove("t")
    turns = {*QUATERNION, *EULER, *TURNS, *MATRIX}
    positions_only = not any(turns & body.keys() for body in bodies.values()) and turns.isdisjoint(explicit)
    if timed and positions_only and set(missing) == set(needed) - set(POSITION):
        problem = f"positions only, and rotations are needed (found {columns_found(cells)})"
        named = ",".join(f"{item}=NAME" for item in missing)
        return header.error(problem, f"record them as qx, qy, qz, qw, or name them: --columns {named}")
    angles = [item for item in (*EULER, *TURNS) if item in nearest]
    if set(QUATERNION) <= set(missing) and set(needed) - set(missing) >= set(POSITION) and angles:
        shown_angles = ", ".join(cells[nearest[angle][0]] for angle in angles[:3])
        return header.error(
            f"rotations are Euler angles here ({shown_angles}), and their order is not said",
            "say it: --euler ORDER, with --degrees if they are (Unity: --euler YXZ --degrees; Nuke: zxy; docs/csv.md)",
        )
    if set(EULER) & set(missing) and set(TURNS) & set(angles):
        return header.error(
            f"roll, pitch and yaw are about other axes in other programs, and {', '.join(missing)} are not named",
            "say which is which: --columns rx=roll,ry=pitch,rz=yaw in ROS, rx=pitch,ry=yaw,rz=roll in Unity",
        )
    others = ",".join(f"{item}=NAME" for item in missing[:3]) + ",..." * (len(missing) > 3)
    way_out = header.advice or f"known are {KNOWN_NAMES}; or --columns {others}"
    if not any(names) and not explicit:
        problem = f"no column has a known name (found {columns_found(cells)})"
        if all(map(is_number, cells)):
            return header.error(problem, f"write a first line of names: {','.join(('t', *needed))}")
        return NoMotion(header.path, problem, way_out, header.number)
    lacking = f" for {shown(label)}" if label else ""
    return header.error(f"no column named {', '.join(missing)}{lacking} (found {columns_found(cells)})", way_out)


def columns_found(cells: Sequence[str]) -> str:
    """Return the columns of a file, as text for an error."""
    names = [cell if len(cell) <= 24 else f"{cell[:24]}..." for cell in dict.fromkeys(cells) if cell]
    return listed(names, limit=MOST_FOUND) or "none"


def require_time_unit(header: HeaderLine, unit: str) -> None:
    """Raise TrajectoryError if the unit of time is unknown. For dates it does not matter: `t [hh:mm:ss]`."""
    if unit and unit not in TICKS_PER_S_BY_UNIT:
        raise header.error(
            f"{shown(unit)} is not a known unit of time", f"--time-unit {', '.join(TICKS_PER_S_BY_UNIT)}"
        )


def metres_of(
    header: HeaderLine, layout: RowLayout, columns: Mapping[str, int], options: ReadingOptions
) -> list[float]:
    """Return the metres per unit of the columns x, y and z. Columns without a unit are in metres.

    Raises TrajectoryError for an unknown unit of length.
    """
    if options.scale is not None:
        return [options.scale] * 3
    units = [layout.units.get(columns[axis], "m") for axis in POSITION]
    unknown = [unit for unit in units if unit not in METRES]
    if unknown:
        problem = f"{shown(unknown[0])} is not a known unit of length"
        raise header.error(problem, "say how many metres it has: --scale 0.001 for millimetres")
    return [METRES[unit] for unit in units]
