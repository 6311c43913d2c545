"""Which columns of a header are which body's time, position and rotation, and what there is to say where they are not.

A row may hold several bodies, each with a name of its own in front of its columns (`left_x`, `right_x`), or one body
of several, which another column names (`device`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .column_names import DEVICES, METRES, TURNS, ColumnName, column_name, unit_in
from .options import TICKS, ReadingOptions
from .recordings import TrajectoryError, listed, shown
from .tables import is_number

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
EULER = ("rx", "ry", "rz")

KNOWN = "t, time, timestamp_ms; x, px, pos_x, position.x; qw, rot_w, rotation.w"
"""What an error says of the names that are known."""

MOST_FOUND = 12
"""Columns that an error names."""


class ColumnProblem(ValueError):
    """Why a header does not do."""

    def __init__(self, problem: str, way_out: str, known: int) -> None:
        self.problem, self.way_out = problem, way_out
        self.known = known
        """How many columns mean something: of the lines that could be the header, that with the most is believed."""

    def at(self, path: Path, line: int) -> TrajectoryError:
        """The same of a line of a file, for the user."""
        return TrajectoryError(path, self.problem, self.way_out, line)


@dataclass(frozen=True)
class Layout:
    """Where everything is in a row, as indices."""

    time: int
    time_unit: str
    """As the file or the user says it, which need not be one of `TICKS`; empty where nothing does."""

    bodies: Mapping[str, Mapping[str, int]]
    """Of each body by name, empty where its columns have none in front: `POSITION`, then `QUATERNION` or `EULER`, and
    maybe `scale`."""

    units: Mapping[int, str]
    """Of columns that tell theirs: a name in `column_names.METRES`, "deg" or "rad"."""

    devices: tuple[int, ...] = ()
    """Columns that may tell whose the row is, the likeliest first."""


@dataclass
class _Found:
    """The columns of one body, as their names have it: each meaning to all columns that could be it."""

    label: str = ""
    columns: dict[str, list[int]] = field(default_factory=dict)

    def add(self, meaning: str, index: int) -> None:
        self.columns.setdefault(meaning, []).append(index)


def layout_of(cells: Sequence[str], options: ReadingOptions) -> Layout:
    """Tell what the columns of a header are.

    Raises
    ------
    ColumnProblem
        Where columns are missing, or more than one could be meant.
    """
    names = [column_name(cell) for cell in cells]
    known = sum(name is not None for name in names)
    explicit = _explicit(cells, options, known)
    bodies = _bodies(names, set(explicit.values()))
    turn = EULER if options.euler else QUATERNION
    needed = (*POSITION, *turn)
    times = [index for index, name in enumerate(names) if name and name.kind == "time"]
    times = [explicit["t"]] if "t" in explicit else [index for index in times if index not in explicit.values()]
    # A date beside a count of seconds says the same again.
    times = [index for index in times if names[index] is None or names[index].axis != "date"] or times
    frames = [index for index, name in enumerate(names) if name and name.kind == "frame"]
    if options.frame_rate and "t" not in explicit:
        times = [index for index in frames if index not in explicit.values()] or times
    whole = {
        key: found for key, found in bodies.items() if all(one in found.columns or one in explicit for one in needed)
    }
    if explicit.keys() >= set(needed):
        whole = {"": _Found()}
    if whole and frames and not times:
        problem = f"no column of time, only one that counts frames ({shown(cells[frames[0]])})"
        raise ColumnProblem(problem, "say how many frames a second it has: --frame-rate 90", known)
    if not times or not whole:
        raise _missing(cells, names, bodies, bool(times), needed, explicit, known)
    where = {found.label: _columns_of(found, cells, (*needed, "scale"), explicit, known) for found in whole.values()}
    time = _only("t", times, cells, known)
    units = {index: name.unit for index, name in enumerate(names) if name and name.unit}
    units |= {index: unit for index in explicit.values() if (unit := unit_in(cells[index]))}
    unit = options.time_unit or units.get(time, "")
    return Layout(time, unit, where, units, _devices(names, explicit))


def _explicit(cells: Sequence[str], options: ReadingOptions, known: int) -> dict[str, int]:
    """The columns that the user named."""
    written = [cell.lower() for cell in cells]
    explicit = {}
    for meaning, column in options.columns:
        wanted = column.strip().lower()
        if wanted not in written:
            raise ColumnProblem(
                f"no column is named {shown(column)}",
                f"--columns {meaning}=NAME takes one of {columns_found(cells)}",
                known,
            )
        explicit[meaning] = written.index(wanted)
    return explicit


def _bodies(names: Sequence[ColumnName | None], explicit: set[int]) -> dict[str, _Found]:
    """The columns of positions, rotations and scales, by the name of the body in front, its case put aside."""
    bodies: dict[str, _Found] = {"": _Found()}
    with_w = {name.body.lower() for name in names if name and name.kind == "rotation" and name.axis == "w"}
    for index, name in enumerate(names):
        if name is None or name.kind in ("time", "frame", "device") or index in explicit:
            continue
        body = bodies.setdefault(name.body.lower(), _Found(name.body))
        if name.kind == "scale":
            body.add("scale", index)
        elif name.kind == "position":
            body.add(name.axis, index)
        elif name.kind == "quaternion" or (name.kind == "rotation" and name.body.lower() in with_w):
            body.add(f"q{name.axis}", index)
        else:
            body.add(name.axis if name.axis in TURNS else f"r{name.axis}", index)
    return bodies


def _columns_of(
    found: _Found, cells: Sequence[str], meanings: Iterable[str], explicit: Mapping[str, int], known: int
) -> dict[str, int]:
    columns = {}
    for meaning in meanings:
        if meaning in explicit:
            columns[meaning] = explicit[meaning]
        elif meaning in found.columns:
            columns[meaning] = _only(meaning, found.columns[meaning], cells, known)
    return columns


def _only(meaning: str, indices: Sequence[int], cells: Sequence[str], known: int) -> int:
    if len(indices) > 1:
        both = listed(list(dict.fromkeys(shown(cells[index]) for index in indices)), limit=3)
        way_out = f"say which with --columns {meaning}=NAME, or rename or delete one of them"
        raise ColumnProblem(f"two columns mean {meaning} ({both})", way_out, known)
    return indices[0]


def _devices(names: Sequence[ColumnName | None], explicit: Mapping[str, int]) -> tuple[int, ...]:
    if "device" in explicit:
        return (explicit["device"],)
    indices = [index for index, name in enumerate(names) if name and name.kind == "device"]
    indices = [index for index in indices if index not in explicit.values()]
    return tuple(sorted(indices, key=lambda index: DEVICES.index(names[index].axis)))


def _missing(
    cells: Sequence[str],
    names: Sequence[ColumnName | None],
    bodies: Mapping[str, _Found],
    timed: bool,
    needed: Sequence[str],
    explicit: Mapping[str, int],
    known: int,
) -> ColumnProblem:
    """What is missing to a header of which nobody is whole: of the body that lacks the least."""
    nearest = max(bodies.values(), key=lambda body: sum(one in body.columns for one in needed))
    if not nearest.columns.keys() >= set(POSITION):
        # Something by chance ends like an axis.
        nearest = bodies[""]
    missing = [one for one in ("t", *needed) if one not in explicit and one not in nearest.columns]
    if timed:
        missing.remove("t")
    turns = {*QUATERNION, *EULER, *TURNS}
    positions_only = not any(turns & body.columns.keys() for body in bodies.values()) and turns.isdisjoint(explicit)
    if timed and positions_only and set(missing) == set(needed) - set(POSITION):
        problem = f"positions only, and rotations are needed (found {columns_found(cells)})"
        named = ",".join(f"{one}=NAME" for one in missing)
        return ColumnProblem(problem, f"record them as qx, qy, qz, qw, or name them: --columns {named}", known)
    angles = [one for one in (*EULER, *TURNS) if one in nearest.columns]
    if set(QUATERNION) <= set(missing) and set(needed) - set(missing) >= set(POSITION) and angles:
        shown_angles = ", ".join(cells[nearest.columns[one][0]] for one in angles[:3])
        return ColumnProblem(
            f"rotations are Euler angles here ({shown_angles}), and their order is not said",
            "say it: --euler ORDER, with --degrees if they are (Unity: --euler YXZ --degrees; docs/csv.md has others)",
            known,
        )
    if set(EULER) & set(missing) and set(TURNS) & set(angles):
        return ColumnProblem(
            f"roll, pitch and yaw are about other axes in other programs, and {', '.join(missing)} are not named",
            "say which is which: --columns rx=roll,ry=pitch,rz=yaw in ROS, rx=pitch,ry=yaw,rz=roll in Unity",
            known,
        )
    others = ",".join(f"{one}=NAME" for one in missing[:3]) + ",..." * (len(missing) > 3)
    way_out = f"known are {KNOWN}; or --columns {others}"
    if not any(names) and not explicit:
        if all(map(is_number, cells)):
            way_out = f"write a first line of names: {','.join(('t', *needed))}"
        return ColumnProblem(f"no column has a known name (found {columns_found(cells)})", way_out, 0)
    lacking = f" for {shown(nearest.label)}" if nearest.label else ""
    return ColumnProblem(
        f"no column named {', '.join(missing)}{lacking} (found {columns_found(cells)})", way_out, known
    )


def columns_found(cells: Sequence[str]) -> str:
    """The columns that a file has, for an error."""
    names = [cell if len(cell) <= 24 else f"{cell[:24]}..." for cell in dict.fromkeys(cells) if cell]
    return listed(names, limit=MOST_FOUND) or "none"


def require_time_unit(layout: Layout) -> None:
    """Raise ColumnProblem where the unit of time is none that is known. Of dates it is no matter: `t [hh:mm:ss]`."""
    if layout.time_unit and layout.time_unit not in TICKS:
        problem = f"{shown(layout.time_unit)} is no unit of time that is known"
        raise ColumnProblem(problem, f"--time-unit {', '.join(TICKS)}", len(layout.units))


def metres_of(layout: Layout, columns: Mapping[str, int], options: ReadingOptions) -> list[float]:
    """The metres of a unit in each of the columns x, y and z, of which those are metres that say nothing.

    Raises ColumnProblem for a unit of length that is not known.
    """
    if options.scale is not None:
        return [options.scale] * 3
    units = [layout.units.get(columns[axis], "m") for axis in POSITION]
    unknown = [unit for unit in units if unit not in METRES]
    if unknown:
        raise ColumnProblem(
            f"{shown(unknown[0])} is no unit of length that is known",
            "say how many metres it has: --scale 0.001 for millimetres",
            len(columns),
        )
    return [METRES[unit] for unit in units]
