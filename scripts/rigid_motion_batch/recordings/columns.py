"""Columns of a header: which are which body's time, position and rotation, and what there is to say where they are not.

A row may hold several bodies, each with a name of its own in front of its columns (`left_x`, `right_x`), or one body
of several, which another column names (`device`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rigid_motion_batch.command_line import listed

from .column_names import DEVICES, METRES, TURNS, ColumnName, column_name, unit_in
from .options import TICKS, ReadingOptions
from .recordings import NoMotion, TrajectoryError, shown
from .tables import HeaderLine, is_number

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
EULER = ("rx", "ry", "rz")

KNOWN = "t, time, timestamp_ms; x, px, pos_x, position.x; qw, rot_w, rotation.w"
"""Text of an error on the names that are known."""

MOST_FOUND = 12
"""Columns that an error names."""


@dataclass(frozen=True)
class Layout:
    """Layout of a row: where everything is, as indices."""

    time: int
    time_unit: str
    """The unit as the file or the user says it, which need not be one of `TICKS`; empty where neither does."""

    bodies: Mapping[str, Mapping[str, int]]
    """The columns of each body by name, empty where its columns have none in front: `POSITION`, then `QUATERNION` or
    `EULER`, and maybe `scale`.
    """

    units: Mapping[int, str]
    """Units of the columns that tell theirs: a name in `column_names.METRES`, "deg" or "rad"."""

    devices: tuple[int, ...] = ()
    """Columns that may tell whose the row is, the likeliest first."""


Found = dict[str, list[int]]
"""Meanings in a body, each to all columns that could be it, by their names."""


def layout_of(header: HeaderLine, options: ReadingOptions) -> Layout:
    """Return what the columns of a header are.

    Raises
    ------
    TrajectoryError
        Where columns are missing, or more than one could be meant.
    """
    cells = header.cells
    names = [column_name(cell) for cell in cells]
    explicit = _explicit(header, options)
    of_kind = {
        kind: [
            index for index, name in enumerate(names) if name and name.kind == kind and index not in explicit.values()
        ]
        for kind in ("time", "frame", "device")
    }
    bodies = _bodies(names, set(explicit.values()))
    needed = (*POSITION, *(EULER if options.euler else QUATERNION))
    whole = {label: result for label, result in bodies.items() if {*result, *explicit} >= {*needed}}
    if explicit.keys() >= set(needed):
        whole = {"": {}}
    # A date beside a count of seconds says the same again.
    axes = [name.axis if name else "" for name in names]
    times = [index for index in of_kind["time"] if axes[index] != "date"] or of_kind["time"]
    times = (options.frame_rate and of_kind["frame"]) or times
    times = [explicit["t"]] if "t" in explicit else times
    if whole and of_kind["frame"] and not times:
        problem = f"no column of time, only one that counts frames ({shown(cells[of_kind['frame'][0]])})"
        raise header.error(problem, "say how many frames a second it has: --frame-rate 90")
    if not times or not whole:
        raise _missing(header, names, bodies, bool(times), needed, explicit)

    def only(meaning: str, indices: Sequence[int]) -> int:
        if len(indices) == 1:
            return indices[0]
        both = listed(list(dict.fromkeys(shown(cells[index]) for index in indices)), limit=3)
        way_out = f"say which with --columns {meaning}=NAME, or rename or delete one of them"
        raise header.error(f"two columns mean {meaning} ({both})", way_out)

    where = {}
    for label, result in whole.items():
        columns = result | {meaning: [index] for meaning, index in explicit.items()}
        where[label] = {item: only(item, columns[item]) for item in (*needed, "scale") if item in columns}
    units = {index: name.unit for index, name in enumerate(names) if name and name.unit}
    units |= {index: unit for index in explicit.values() if (unit := unit_in(cells[index]))}
    time = only("t", times)
    devices = sorted(of_kind["device"], key=lambda index: DEVICES.index(axes[index]))
    devices = [explicit["device"]] if "device" in explicit else devices
    return Layout(time, options.time_unit or units.get(time, ""), where, units, tuple(devices))


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
    """Return the columns of positions, rotations and scales, by the name of the body in front, whatever its case."""
    bodies: dict[str, Found] = {"": {}}
    labels: dict[str, str] = {"": ""}
    with_w = {name.body.lower() for name in names if name and name.kind == "rotation" and name.axis == "w"}
    for index, name in enumerate(names):
        if name is None or name.kind in ("time", "frame", "device") or index in explicit:
            continue
        body = name.body.lower()
        if name.kind == "scale" or name.kind == "position" or name.axis in TURNS:
            meaning = name.axis or "scale"
        else:
            meaning = f"{'q' if name.kind == 'quaternion' or body in with_w else 'r'}{name.axis}"
        bodies.setdefault(labels.setdefault(body, name.body), {}).setdefault(meaning, []).append(index)
    return bodies


def known_in(header: HeaderLine) -> int:
    """Return how many columns mean something: of the lines that could be the header, the one with the most is taken."""
    return sum(column_name(cell) is not None for cell in header.cells)


def _missing(
    header: HeaderLine,
    names: Sequence[ColumnName | None],
    bodies: Mapping[str, Found],
    timed: bool,
    needed: Sequence[str],
    explicit: Mapping[str, int],
) -> TrajectoryError:
    """Return what is missing to a header of which no body is whole: of the body that lacks the least."""
    cells = header.cells
    label, nearest = max(bodies.items(), key=lambda body: sum(item in body[1] for item in needed))
    if not nearest.keys() >= set(POSITION):
        # Something by chance ends like an axis.
        label, nearest = "", bodies[""]
    missing = [item for item in ("t", *needed) if item not in explicit and item not in nearest]
    if timed:
        missing.remove("t")
    turns = {*QUATERNION, *EULER, *TURNS}
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
            "say it: --euler ORDER, with --degrees if they are (Unity: --euler YXZ --degrees; docs/csv.md has others)",
        )
    if set(EULER) & set(missing) and set(TURNS) & set(angles):
        return header.error(
            f"roll, pitch and yaw are about other axes in other programs, and {', '.join(missing)} are not named",
            "say which is which: --columns rx=roll,ry=pitch,rz=yaw in ROS, rx=pitch,ry=yaw,rz=roll in Unity",
        )
    others = ",".join(f"{item}=NAME" for item in missing[:3]) + ",..." * (len(missing) > 3)
    way_out = f"known are {KNOWN}; or --columns {others}"
    if not any(names) and not explicit:
        problem = f"no column has a known name (found {columns_found(cells)})"
        if all(map(is_number, cells)):
            return header.error(problem, f"write a first line of names: {','.join(('t', *needed))}")
        return NoMotion(header.path, problem, way_out, header.number)
    lacking = f" for {shown(label)}" if label else ""
    return header.error(f"no column named {', '.join(missing)}{lacking} (found {columns_found(cells)})", way_out)


def columns_found(cells: Sequence[str]) -> str:
    """Return the columns that a file has, for an error."""
    names = [cell if len(cell) <= 24 else f"{cell[:24]}..." for cell in dict.fromkeys(cells) if cell]
    return listed(names, limit=MOST_FOUND) or "none"


def require_time_unit(header: HeaderLine, unit: str) -> None:
    """Raise TrajectoryError where the unit of time is none that is known. Of dates it is no matter: `t [hh:mm:ss]`."""
    if unit and unit not in TICKS:
        raise header.error(f"{shown(unit)} is no unit of time that is known", f"--time-unit {', '.join(TICKS)}")


def metres_of(header: HeaderLine, layout: Layout, columns: Mapping[str, int], options: ReadingOptions) -> list[float]:
    """Return the metres of a unit in each of the columns x, y and z, of which those are metres that say nothing.

    Raises TrajectoryError for a unit of length that is not known.
    """
    if options.scale is not None:
        return [options.scale] * 3
    units = [layout.units.get(columns[axis], "m") for axis in POSITION]
    unknown = [unit for unit in units if unit not in METRES]
    if unknown:
        problem = f"{shown(unknown[0])} is no unit of length that is known"
        raise header.error(problem, "say how many metres it has: --scale 0.001 for millimetres")
    return [METRES[unit] for unit in units]
