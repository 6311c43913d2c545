"""Tables with one row per line: with named columns, with unnamed columns, and the cameras of COLMAP and g2o.

Columns have names in any order, as loggers write them: `t,x,y,z,qx,qy,qz,qw`, `timestamp_ms,pos_x,...,rot_w`.
`column_names` says which names are known, and `columns` how columns become bodies: several in a row, or one of several
that another column names. The names give the order of the quaternion; other columns are ignored. Separators are commas,
semicolons or tabs; with the latter two, numbers may have a decimal comma. The program's own files
(`t,x,y,z,qw,qx,qy,qz`) are such CSVs.

Rows of unnamed numbers are those of TUM, KITTI, pose matrices, EuRoC, VINS and OpenVINS, and Nuke's .chan. If a comment
names the columns (`# timestamp tx ty tz qx qy qz qw`), the names are used. Otherwise the numbers show the layout: a
matrix has orthogonal axes, a quaternion has length 1. Columns may be named by their place, `--columns t=1,x=2`. No
number shows at which end of a quaternion w is. It is taken to be last, as in TUM, unless the first rotation is 1 0 0 0.
In rows with commas, as of EuRoC and VINS, it is at the end with the larger number in the first row. A guess is a
warning. Nuke's axes are right-handed, y up, and its cameras look along -z.

COLMAP's images.txt and g2o's graphs have no times, only numbers of images or vertices, and need a rate. COLMAP has two
lines for each image, in any order, and the world as seen by the camera: the camera's pose is the inverse. Cameras look
along z, with x to the right and y down. The axes of the world may be any, and mostly are those of a camera, too. The
unit of length may be any.
Sources: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats,
https://www.cvlibs.net/datasets/kitti/eval_odometry.php, https://colmap.github.io/format.html#images-txt,
https://github.com/RainerKuemmerle/g2o/wiki/File-Format-SLAM-3D.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path

import numpy as np

from .clips import ClipWarning
from .column_names import ColumnName
from .columns import columns_found, known_in, layout_of
from .options import ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError
from .tables import HeaderLine, header_lines, is_number, lines_of, lines_of_words
from .tracks import read_below

MIN_ROW_NUMBERS = 3
"""Numbers that a row of a recording has at least."""

LOOKED_AT = 500
"""Rows that determine the meaning of the columns."""

MIN_ALIKE_RATIO = 0.9
"""Share of these rows that must agree."""

MAX_AXES_ERROR = 0.02
"""Tolerance for lengths of 1 and dot products of 0, in files of few digits."""

TUM_NUMBERS = 8
"""Numbers in a row of TUM."""

MIN_FIRST_LARGER_RATIO = 0.75
"""Share of rows above which w may be first: those with the first number of four larger than the last."""

MAX_UNTURNED_W_ERROR = 1e-6
"""Distance from 1 of the w of a body that has not turned yet: trackers often begin so."""

POSITIONS_ONLY = 4
"""Numbers in a row of time and position."""

MIN_AXIS_LENGTH = 1e-12
"""Lower bound for the length of axes, against division by 0."""

ROTATION_COLUMNS = [0, 1, 2, 4, 5, 6, 8, 9, 10]
"""The places of the axes in a row of matrix numbers."""

POSITION = [ColumnName("position", axis) for axis in "xyz"]
TIME = [ColumnName("time")]
MATRIX = [ColumnName("matrix", f"{row}{column}") for row in range(4) for column in range(4)]
CHAN = [ColumnName("frame"), *POSITION, *(ColumnName("euler", axis, "deg") for axis in "xyz")]

COLMAP = ["frame", "device", "qw", "qx", "qy", "qz", "x", "y", "z"]

VERTEX = "VERTEX_SE3:QUAT"

G2O = ["", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"]


# -- named columns -----------------------------------------------------------------------------------------------------


def read_named(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the requested bodies. A body without a name gets that of the file."""
    header = _find_header(path, options)
    way_out = f"name the column that tells them apart, --columns device=NAME (found {columns_found(header.cells)})"
    return read_below(selection, options, header, f"{way_out}, or split the file")


def _find_header(path: Path, options: ReadingOptions) -> HeaderLine:
    """Return the line that names all needed columns: one of the first lines, or the only one further down.

    If there is none, raises TrajectoryError with what the best candidate lacks.
    """
    first = [line.of_rows() for line in header_lines(path)]
    result: list[HeaderLine] = []
    problems: list[tuple[int, TrajectoryError]] = []
    for line in chain(first, lines_of_words(path, first[-1].number)):
        try:
            layout_of(line, options)
        except TrajectoryError as error:
            problems.append((known_in(line), error))
            continue
        if line in first:
            return line
        result.append(line)
    if len(result) == 1:
        return result[0]
    if result:
        numbers = " and ".join(str(line.number) for line in result[:2])
        problem = f"lines {numbers} both name columns, with others before them"
        raise result[0].error(problem, "make a file of each table, without what is before it")
    known, nearest = max(problems, key=itemgetter(0))
    raise nearest if known else problems[len(first) - 1][1]


# -- rows of numbers ---------------------------------------------------------------------------------------------------


def recognises_rows(head: list[str]) -> bool:
    """Return whether the first row that is not a comment consists of numbers."""
    row = next((line for line in head if line.strip() and not line.lstrip().startswith("#")), "")
    cells = _cells(row)
    return len(cells) >= MIN_ROW_NUMBERS and all(map(is_number, cells))


def read_rows(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the single body of the file, named after the file."""
    return read_below(selection, options, _header(path, options), "write a file for each")


def _header(path: Path, options: ReadingOptions) -> HeaderLine:
    """Return the line that names the columns, or else a header made up from the numbers of the first rows."""
    *comments, row = header_lines(path)
    for line in comments:
        with suppress(TrajectoryError):
            layout_of(line, options)
            return replace(line, separator=row.separator) if len(row.cells) == len(line.cells) else line
    text = next(lines_of(path, after=row.number - 1))[1]
    cells = [str(place) for place, _ in enumerate(_cells(text), 1)]
    header = HeaderLine(path, row.number - 1, _separator(text), cells)
    names, warnings = _guessed_names(header)
    warnings = () if "qw" in dict(options.columns) else warnings
    if not names and not options.columns:
        if len(cells) == POSITIONS_ONLY:
            problem = "positions only, and rotations are needed"
            raise TrajectoryError(path, problem, "write t x y z qx qy qz qw in every line", row.number)
        problem = f"{len(cells)} numbers in a row, which are not known poses"
        way_out = "write a first line of names, or say which is which by its place: --columns t=1,x=2,..."
        raise TrajectoryError(path, problem, way_out, row.number)
    header = replace(header, names=[*names, *[None] * len(cells)][: len(cells)], warnings=warnings)
    return replace(header, axes="opengl") if names is CHAN else header


def _separator(row: str) -> str | None:
    """Return the separator of numbers; None for white space. With separators other than commas, commas are decimal."""
    return next((mark for mark in ";\t," if mark in row.strip()), None)


def _cells(row: str) -> list[str]:
    """Return the cells of a row, without empty cells at the end."""
    separator = _separator(row)
    return (row if separator == "," else row.replace(",", ".")).strip().rstrip(separator).split(separator)


def _guessed_names(header: HeaderLine) -> tuple[list[ColumnName], tuple[ClipWarning, ...]]:
    """Return the meanings of the columns below a header, as far as needed; empty if the numbers do not show them."""
    if header.path.suffix.lower() == ".chan":
        return CHAN, ()
    table = _numbers(header)
    width = table.shape[1]
    for first in (1, 0):
        if width - first >= 12 and _mostly(_is_rotation, table[:, first:][:, ROTATION_COLUMNS]):
            return [*TIME[:first], *MATRIX[: 16 if width - first >= 16 else 12]], ()
    for first in (1, 0) if width >= TUM_NUMBERS else (0,) if width == TUM_NUMBERS - 1 else ():
        before, block = TIME[:first], table[:, first:]
        if _mostly(_is_unit, block[:, 3:7]) or (width == TUM_NUMBERS and not _mostly(_is_unit, block[:, :4])):
            order, warnings = _quaternion_order(header, block[:, 3:7], 4 + first)
            return [*before, *POSITION, *order], warnings
        if _mostly(_is_unit, block[:, :4]):
            return [*before, *_quaternion("xyzw"), *POSITION], ()
    return [], ()


def _numbers(header: HeaderLine) -> np.ndarray:
    """Return the numbers of the first rows, NaN for missing ones."""
    width = len(header.cells)
    table = np.full((LOOKED_AT, width), np.nan)
    for row, (_, line) in enumerate(islice(header.rows(), LOOKED_AT)):
        cells = _cells(line)[:width]
        table[row, : len(cells)] = [float(cell) if is_number(cell) else np.nan for cell in cells]
    return table


def _mostly(fits: Callable[[np.ndarray], np.ndarray], rows: np.ndarray) -> bool:
    """Return whether nearly all rows fit, ignoring rows that are incomplete or all zeros."""
    known = rows[np.isfinite(rows).all(axis=1) & rows.any(axis=1)]
    with np.errstate(over="ignore", invalid="ignore"):
        return len(known) > 0 and bool(fits(known).mean() >= MIN_ALIKE_RATIO)


def _is_unit(rows: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(rows, axis=1) - 1.0) < MAX_AXES_ERROR


def _is_rotation(rows: np.ndarray) -> np.ndarray:
    """Return which rows of nine numbers are orthogonal axes of equal length."""
    axes = rows.reshape(-1, 3, 3)
    axes = axes / np.maximum(np.linalg.norm(axes, axis=2).mean(axis=1), MIN_AXIS_LENGTH)[:, None, None]
    return np.abs(axes @ axes.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) < MAX_AXES_ERROR


def _quaternion(order: str) -> list[ColumnName]:
    return [ColumnName("quaternion", axis) for axis in order]


def _quaternion_order(
    header: HeaderLine, four: np.ndarray, place: int
) -> tuple[list[ColumnName], tuple[ClipWarning, ...]]:
    """Return the order of a quaternion's four numbers, the first in column `place`, and a warning if it is guessed."""
    first, last = np.abs(four[np.isfinite(four).all(axis=1)])[:, [0, 3]].T
    if header.path.suffix.lower() == ".tum" or not len(first):
        return _quaternion("xyzw"), ()
    commas = header.separator == ","
    at_first = bool(first[0] >= last[0] if commas else first[0] > 1.0 - MAX_UNTURNED_W_ERROR)
    if not commas and not at_first and np.mean(first > last) < MIN_FIRST_LARGER_RATIO:
        return _quaternion("xyzw"), ()
    taken, other = ("wxyz", "xyzw") if at_first else ("xyzw", "wxyz")
    columns = ",".join(f"q{axis}={place + number}" for number, axis in enumerate(other))
    text = (
        f"its columns have no names, and the {'first' if at_first else 'last'} of the four of a rotation is taken for w"
    )
    return _quaternion(taken), (ClipWarning(text, f"if it is the other way round: --columns {columns}"),)


# -- cameras -----------------------------------------------------------------------------------------------------------


def recognises_images(head: list[str]) -> bool:
    """Return whether this is COLMAP's images.txt, from its comments, or from its first image."""
    rows = [line for line in head if not line.startswith("#")]
    return any("POINTS2D[]" in line for line in head) or bool(rows and _image_cells(rows[0]))


def read_images(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the cameras of COLMAP's images.txt. If images are in folders, each folder is a body."""
    remark = "poses of the world were turned into those of the camera; COLMAP's unit of length may be any (--scale)"
    header = HeaderLine(path, 0, "\t", COLMAP, rows_of=_images, inverted=True, axes="opencv", remark=remark, shift=1)
    return read_below(selection, options, header, "name the folder of each camera's images in front of their names")


def _images(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield a row for each image, sorted by name: the last number in its name, its folder, and the pose."""
    images = [(number, cells) for number, line in lines if (cells := _image_cells(line))]
    for place, (number, cells) in enumerate(sorted(images, key=lambda image: in_order(image[1][-1]))):
        yield number, "\t".join([number_in(cells[-1], place), cells[-1].rpartition("/")[0], *cells[1:8]])


def _image_cells(line: str) -> list[str] | None:
    """Return the cells of an image's first line: its number, quaternion, position, camera, and name.

    Returns None for any other line, such as the line of its points, which ends with a number.
    """
    cells = line.split(maxsplit=9)
    numbers = len(cells) == 10 and cells[0].isdecimal() and cells[8].isdecimal() and all(map(is_number, cells[1:8]))
    return cells if numbers and not is_number(cells[9].split()[-1]) else None


def in_order(name: str) -> list[tuple[int, str]]:
    """Return a sort key for names in natural order: 9 before 10."""
    return [(int(part or 0), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d{1,18})", name)]


def number_in(name: str, otherwise: int) -> str:
    """Return the last number in the file name of an image, or else `otherwise`."""
    file = name.rpartition("/")[2]
    numbers = re.findall(r"\d{1,15}", file.rpartition(".")[0] or file)
    return numbers[-1] if numbers else str(otherwise)


def recognises_graph(head: list[str]) -> bool:
    """Return whether this is a g2o graph, where every row begins with a word."""
    return any(line.startswith((VERTEX, "EDGE_SE3:QUAT")) for line in head)


def read_graph(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the vertices of a graph, ordered by number."""
    header = HeaderLine(path, 0, None, G2O, rows_of=_vertices, advice="export the vertices, too")
    return read_below(selection, options, header, "write a file for each")


def _vertices(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    rows = [(number, line) for number, line in lines if line.startswith(VERTEX)]
    return iter(sorted(rows, key=lambda row: in_order((*row[1].split(maxsplit=2), "", "")[1])))
