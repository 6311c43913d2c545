"""Text files of numbers: lines, named columns, and rows parsed by NumPy's C parser.

A row that cannot be parsed is looked for only after the parser has refused, so that a good file pays nothing for
errors that name their line.
"""

from __future__ import annotations

import codecs
import csv
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from addon.motion import Poses

from .recordings import Trajectory, TrajectoryError, shown

Columns = Mapping[str, Sequence[str]]
"""What a column means, to the names that it goes by."""

SEPARATORS = (",", ";", "\t")


@dataclass(frozen=True, eq=False)
class Table:
    """The rows of a file, unparsed, and where its columns are."""

    path: Path
    separator: str | None
    """None means white space."""

    columns: dict[str, int]
    """What a column means, to its index."""

    width: int
    """How many columns have a name."""

    rows: list[tuple[int, str]]
    """The rows with the numbers of their lines."""

    def parse(self, columns: Sequence[str], dtype: type = np.float64) -> np.ndarray:
        """The numbers in these columns, shape (rows, columns). Empty cells are NaN."""
        return parse_rows(
            self.path, self.rows, self.separator, {name: self.columns[name] for name in columns}, self.width, dtype
        )

    def trajectory(self, name: str) -> Trajectory:
        """The columns t, x, y, z, qw, qx, qy, qz and, if there, scale."""
        names = ["t", "x", "y", "z", "qw", "qx", "qy", "qz", "scale"]
        numbers = self.parse([name for name in names if name in self.columns])
        scales = numbers[:, 8] if "scale" in self.columns and np.any(numbers[:, 8] != 1.0) else None
        return Trajectory(name, numbers[:, 0], Poses(numbers[:, 1:4], numbers[:, 4:8], scales))


def decode(data: bytes, errors: str = "strict") -> str:
    """UTF-8 or, where the byte order mark says so, UTF-16."""
    utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if utf16 else "utf-8-sig", errors)


def read_text(path: Path) -> str:
    """The text of the file, its line ends made `\\n`."""
    data = path.read_bytes()
    try:
        text = decode(data)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise TrajectoryError(
            path, f"this is not text (byte 0x{data[error.start]:02x})", "save the file as UTF-8", line
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise TrajectoryError(path, "this is not text but binary data", "name a text file", line)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_lines(path: Path) -> list[str]:
    """The lines of the file, without their ends."""
    return read_text(path).split("\n")


def cells_of(path: Path, number: int, line: str, separator: str | None) -> list[str]:
    """The cells of a header's line, without quotes and surrounding blanks."""
    if separator is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error as error:
        raise TrajectoryError(path, f"this line is no header ({error})", "name a file of columns", number) from None


def read_table(path: Path, names: Columns, optional: Columns, default: Sequence[str] = ()) -> Table:
    """The table whose header names all the columns in `names`.

    Parameters
    ----------
    path : Path
    names, optional : mapping from meaning to names
        Names are lower case, without their unit in brackets.
    default : sequence of str
        The meanings of the columns, in order, of a file without a header; such a file is separated by white space.

    Notes
    -----
    The header is the first line, or a comment before it, as `numpy.savetxt` and EuRoC have it. Blank lines and
    comments (`#`) between the rows are skipped.
    """
    lines = read_lines(path)
    expected = ", ".join(aliases[0] for aliases in names.values())
    if not any(line.strip() for line in lines):
        raise TrajectoryError(path, "the file is empty", f"it needs the columns {expected}")
    partial: tuple[int, list[str]] | None = None
    first = len(lines)
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text:
            continue
        header = text.lstrip("# \t")
        separator = max(SEPARATORS, key=header.count) if any(mark in header for mark in SEPARATORS) else None
        cells = [cell.partition("[")[0].strip().lower() for cell in cells_of(path, number, header, separator)]
        meanings = [_meaning_of(cell, {**names, **optional}) for cell in cells]
        columns = {meaning: index for index, meaning in enumerate(meanings) if meaning}
        missing = [meaning for meaning in names if meaning not in columns]
        if not missing:
            if repeated := [meaning for meaning in columns if meanings.count(meaning) > 1]:
                raise TrajectoryError(path, f"two columns mean {repeated[0]}", "rename or delete one of them", number)
            return Table(path, separator, columns, len(cells), _rows(lines, number))
        if columns and (partial is None or len(missing) < len(partial[1])):
            partial = number, missing
        if not text.startswith("#"):
            first = number
            break
    if default and not (partial and partial[0] == first):
        columns = {meaning: index for index, meaning in enumerate(default)}
        return Table(path, None, columns, len(default), _rows(lines, first - 1))
    if partial is None:
        raise TrajectoryError(path, "no column has a known name", f"the first line has to name {expected}", first)
    number, missing = partial
    absent = ", ".join(names[meaning][0] for meaning in missing)
    raise TrajectoryError(path, f"no column named {absent}", f"the header has to name {expected}", number)


def _meaning_of(cell: str, names: Columns) -> str | None:
    return next((meaning for meaning, aliases in names.items() if cell in aliases), None)


def _rows(lines: Sequence[str], after: int) -> list[tuple[int, str]]:
    stripped = ((number, line.strip(" ")) for number, line in enumerate(lines[after:], start=after + 1))
    return [(number, line) for number, line in stripped if line.strip() and not line.startswith("#")]


def parse_rows(
    path: Path,
    rows: Sequence[tuple[int, str]],
    separator: str | None,
    columns: Mapping[str, int],
    width: int,
    dtype: type = np.float64,
) -> np.ndarray:
    """The numbers of some columns.

    Parameters
    ----------
    path : Path
        For the errors.
    rows : sequence of (line number, line)
    separator : str or None
        None means white space. Where it is not a comma, a comma is taken as the decimal sign.
    columns : mapping from name to index
        Which columns, in which order.
    width : int
        How many cells a row may have. Empty ones beyond are no matter; too few matter where a wanted one is missing.
    dtype : type
        Of the result.

    Returns
    -------
    array, shape (rows, columns)
        Empty cells are NaN.

    Raises
    ------
    TrajectoryError
        With the number of the line.
    """
    if not rows:
        return np.empty((0, len(columns)), dtype)
    needed = max(columns.values()) + 1
    empty = re.compile(f"(^|{separator}) *(?={separator}|$)")
    lines = []
    for number, line in rows:
        if separator is None:
            count = len(line.split())
        else:
            if '"' in line:
                line = line.replace('"', "")
            if separator != "," and "," in line:
                line = line.replace(",", ".")
            if (
                separator * 2 in line
                or f"{separator} " in line
                or line.startswith(separator)
                or line.endswith(separator)
            ):
                line = empty.sub(r"\1nan", line)
            count = line.count(separator) + 1
        if count > width and not _only_blanks_beyond(line, separator, width):
            raise TrajectoryError(path, f"{count} columns where {width} have a name", "correct the line", number)
        if count < needed:
            raise TrajectoryError(
                path, f"{count} columns where {needed} are needed", "correct or delete the line", number
            )
        lines.append(line)
    indices = list(columns.values())
    try:
        return _load(lines, separator, indices, dtype)
    except _UNPARSABLE:
        row = _first_unparsable(lines, separator, indices, dtype)
    number, cells = rows[row][0], lines[row].split(separator)
    kind = "a whole number" if np.issubdtype(dtype, np.integer) else "a number"
    wrong = _first_unparsable([cells[index] for index in indices], separator, [0], dtype)
    name, cell = list(columns)[wrong], cells[indices[wrong]].strip()
    raise TrajectoryError(path, f"{name} is {shown(cell)}, not {kind}", "correct or delete the line", number)


def _only_blanks_beyond(line: str, separator: str | None, width: int) -> bool:
    return separator is not None and all(cell == "nan" for cell in line.split(separator)[width:])


_UNPARSABLE = (ValueError, OverflowError, DeprecationWarning)


def _load(lines: list[str], separator: str | None, columns: list[int], dtype: type) -> np.ndarray:
    with warnings.catch_warnings():
        # NumPy only warns where it reads 1.5e18 as an integer, which loses digits.
        warnings.simplefilter("error", DeprecationWarning)
        return np.loadtxt(lines, dtype, comments=None, delimiter=separator, usecols=columns, ndmin=2)


def _first_unparsable(lines: list[str], separator: str | None, columns: list[int], dtype: type) -> int:
    """The index of the first line that cannot be parsed, of lines among which there is one."""
    first, last = 0, len(lines)
    while last - first > 1:
        middle = (first + last) // 2
        try:
            _load(lines[first:middle], separator, columns, dtype)
            first = middle
        except _UNPARSABLE:
            last = middle
    return first
