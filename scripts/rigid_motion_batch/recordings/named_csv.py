"""CSV with named columns in any order, as loggers write them: `t,x,y,z,qx,qy,qz,qw`, `timestamp_ms,pos_x,...,rot_w`.

`column_names` says which names are known, and `columns` how they become bodies: several in a row, or one of several
that another column names. The quaternion's order is that of the names; other columns are ignored. Separated by commas,
semicolons or tabs; with the latter two, numbers may have a decimal comma. The program's own files
(`t,x,y,z,qw,qx,qy,qz`) are such CSVs. Units in names are honoured: times become seconds, and the unit of the positions
is `Trajectory.metres_per_unit`. Euler angles need their order from the user.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from operator import itemgetter
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses

from .clips import ClipWarning
from .columns import EULER, POSITION, Layout, columns_found, known_in, layout_of, metres_of, require_time_unit
from .euler import quaternions_from_intrinsic_eulers
from .options import ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError, unique
from .sense import require_one_body
from .tables import HeaderLine, Table, header_lines, lines_above_numbers
from .times import kind_of_times, require_seconds, seconds_of, seconds_of_dates

MOST_LABELS = 0.5
"""The share of the rows up to which different texts in a column can be names of devices. Running numbers are not."""

MOST_DEVICES = 1000
"""Different texts in a column beyond are no names of devices."""

LARGEST_RADIANS = 4.0 * np.pi
"""Two turns. Angles beyond, of which nothing says that they are radians, are degrees."""

SMALLEST_DEGREES = np.pi
"""Angles that are all below this, and said to be degrees, may be radians."""


@dataclass(frozen=True, eq=False)
class _Body:
    """One body of the file: its columns, and its rows."""

    name: str
    prefix: str
    """The prefix of its columns."""

    columns: Mapping[str, int]
    rows: np.ndarray | slice

    def label(self, meaning: str) -> str:
        """Return what errors call a column."""
        return f"{self.prefix} {meaning}".strip()


def read(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the requested bodies. One without a name of its own has the file's."""
    header = _find_header(path, options)
    way_out = f"name the column that tells them apart, --columns device=NAME (found {columns_found(header.cells)})"
    return read_below(selection, options, header, f"{way_out}, or split the file")


def read_below(selection: Selection, options: ReadingOptions, header: HeaderLine, way_out: str) -> list[Trajectory]:
    """Read the requested bodies of the rows below a header; `way_out` is what to do with devices that are mixed."""
    layout = layout_of(header, options)
    bodies = _bodies(header, layout, "device" in dict(options.columns))
    taken = set(selection.of([body.name for body in bodies]))
    requested = [body for body in bodies if body.name in taken]
    columns = {"t": layout.time}
    for body in requested:
        columns |= {body.label(one): index for one, index in body.columns.items()}
    table = Table(header, columns)
    kind = kind_of_times(table)
    if kind and (options.time_unit or options.frame_rate):
        given = f"--time-unit {options.time_unit}" if options.time_unit else f"--frame-rate {options.frame_rate:g}"
        problem = f"{given} is for times that are numbers, and these have {kind}"
        raise header.error(problem, "leave it out")
    parsed = [name for name in columns if name != "t" or kind is None]
    numbers = dict(zip(parsed, table.parse(parsed).T, strict=True))
    if kind:
        times = seconds_of_dates(table, kind)
    elif options.frame_rate:
        times = numbers["t"] / options.frame_rate
    else:
        require_time_unit(header, layout.time_unit)
        for body in requested:
            require_seconds(table, numbers["t"][body.rows], layout.time_unit)
        times = seconds_of(table, numbers["t"], layout.time_unit)
    trajectories = []
    for body in requested:
        held = {column: numbers[body.label(column)][body.rows] for column in body.columns}
        trajectory = replace(_trajectory(header, body, times[body.rows], held, layout, options), dated=kind is not None)
        require_one_body(trajectory, header.path, way_out, header.number)
        trajectories.append(trajectory)
    return trajectories


def _find_header(path: Path, options: ReadingOptions) -> HeaderLine:
    """Find the line that names all that is needed: one of the first, or the only one further down that numbers follow.

    Where none does, TrajectoryError says what the nearest lacks.
    """
    result: list[HeaderLine] = []
    problems: list[tuple[int, TrajectoryError]] = []
    first = (line.of_rows() for line in header_lines(path))
    for is_first, lines in ((True, first), (False, lines_above_numbers(path))):
        for line in lines:
            try:
                layout_of(line, options)
                result.append(line)
            except TrajectoryError as error:
                problems.append((known_in(line), error))
            if result and is_first:
                return result[0]
    if len(result) == 1:
        return result[0]
    if result:
        numbers = " and ".join(str(line.number) for line in result[:2])
        problem = f"lines {numbers} both name columns, with others before them"
        raise result[0].error(problem, "make a file of each table, without what is before it")
    known, nearest = max(problems, key=itemgetter(0))
    raise nearest if known else problems[-1][1]


def _bodies(header: HeaderLine, layout: Layout, named: bool) -> list[_Body]:
    """Return all bodies in the order of columns and rows; `named` is whether the user named their column."""
    columns = {f"device {index}": index for index in layout.devices}
    groups = _devices(Table(header, columns), named)
    bodies = [
        (f"{device} {prefix}".strip() or header.path.stem, prefix, columns, rows)
        for device, rows in groups.items()
        for prefix, columns in layout.bodies.items()
    ]
    names = unique([name for name, *_ in bodies])
    return [_Body(name, prefix, columns, rows) for name, (_, prefix, columns, rows) in zip(names, bodies, strict=True)]


def _devices(table: Table, named: bool) -> dict[str, np.ndarray | slice]:
    """Return the rows of each device, by the first column that tells several apart, or else that tells one."""
    only = ""
    for column in table.columns:
        codes, of_rows = _codes(table.cells(column))
        if len(codes) > MOST_DEVICES and named:
            problem = f"more than {MOST_DEVICES} different values in the column of devices"
            raise table.header.error(problem, "name another with --columns device=NAME")
        if len(codes) > min(max(MOST_LABELS * len(of_rows), 1), MOST_DEVICES) and not named:
            continue
        if len(codes) > 1:
            order = np.argsort(of_rows, kind="stable")
            rows = np.split(order, np.flatnonzero(np.diff(of_rows[order])) + 1)
            return dict(zip(codes, rows, strict=True))
        only = only or next(iter(codes), "")
    return {only: slice(None)}


def _codes(cells: Iterator[tuple[int, str]]) -> tuple[dict[str, int], np.ndarray]:
    """Return a number for each text, of up to so many as there may be devices and one more, and those of the rows."""
    codes: dict[str, int] = {}
    rows = takewhile(lambda _: len(codes) <= MOST_DEVICES, cells)
    return codes, np.fromiter((codes.setdefault(text, len(codes)) for _, text in rows), np.int64)


def _trajectory(
    header: HeaderLine,
    body: _Body,
    times: np.ndarray,
    held: Mapping[str, np.ndarray],
    layout: Layout,
    options: ReadingOptions,
) -> Trajectory:
    metres = metres_of(header, layout, body.columns, options)
    positions = np.column_stack([held[axis] for axis in POSITION])
    if len(set(metres)) > 1:
        positions, metres = positions * metres, [1.0]
    warnings: tuple[ClipWarning, ...] = ()
    if options.euler:
        angles = np.column_stack([held[f"r{axis.lower()}"] for axis in options.intrinsic_order])
        angles, warnings = _radians(
            header, angles, [layout.units.get(body.columns[item], "") for item in EULER], options
        )
        quaternions = quaternions_from_intrinsic_eulers(angles, options.intrinsic_order)
    else:
        quaternions = np.column_stack([held[item] for item in ("qw", "qx", "qy", "qz")])
    scales = held["scale"] if np.any(held.get("scale", 1.0) != 1.0) else None
    return Trajectory(body.name, times, Poses(positions, quaternions, scales), metres[0], warnings=warnings)


def _radians(
    header: HeaderLine, angles: np.ndarray, units: Sequence[str], options: ReadingOptions
) -> tuple[np.ndarray, tuple[ClipWarning, ...]]:
    """Return angles of shape (n, 3) as radians, and what is hard to believe of them."""
    largest = float(np.nanmax(np.abs(angles), initial=0.0, where=np.isfinite(angles)))
    warnings: tuple[ClipWarning, ...] = ()
    if options.degrees and len(angles) and 0.0 < largest <= SMALLEST_DEGREES:
        text = f"its angles are all within {largest:.3g} degrees"
        warnings = (ClipWarning(text, "radians need no --degrees"),)
    if options.degrees or "deg" in units:
        return np.radians(angles), warnings
    if "rad" not in units and largest > LARGEST_RADIANS:
        way_out = "say so: --degrees; or name the columns of radians rx_rad, ry_rad, rz_rad"
        raise header.error(f"angles go up to {largest:.4g}, which are no radians", way_out)
    return angles, ()
