"""Text files of numbers: lines, named columns, and rows parsed by NumPy's C parser.

A file is gone through piece by piece, so that it is the numbers that take memory and not the text, and nothing that
a file says of itself is believed before it has been read. A row that cannot be parsed is looked for only after the
parser has refused, so that a good file pays nothing for errors that name their line.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses

from .recordings import Trajectory, TrajectoryError, shown
from .vector_cells import expanded, flattened, is_number

Columns = Mapping[str, Sequence[str]]
"""What a column means, to the names that it goes by."""

SEPARATORS = (",", ";", "\t")

LARGEST_FILE = 1 << 30
"""Bytes. Files beyond are refused: an hour of a hundred bodies at 90 Hz has half as many."""

MOST_ROWS = 20_000_000
"""Files with more are refused: they would be two days at 100 Hz."""

LONGEST_LINE = 1 << 22
"""Characters. What has longer lines is no table."""

MOST_COLUMNS = 100_000
"""Ten thousand bodies have fewer."""

PIECE = 1 << 18
"""Bytes that are read at once."""

BLOCK = 1 << 14
"""Rows that are parsed at once."""

MOST_COMMENTS = 100
"""Lines. Behind so many no header is looked for."""

MOST_METADATA = 50
"""Lines. Among so many a header is looked for that has others before it."""


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

    header: int
    """The line before the first row."""

    vectors: bool = False
    """Whether cells hold vectors, which count as several columns."""

    def parse(self, columns: Sequence[str], dtype: type = np.float64) -> np.ndarray:
        """The numbers in these columns, shape (rows, columns). Empty cells are NaN."""
        wanted = {name: self.columns[name] for name in columns}
        needed = max(self.columns.values()) + 1
        return parse_rows(self.path, self._rows(), self.separator, wanted, self.width, dtype, needed=needed)

    def cells(self, column: str) -> Iterator[tuple[int, str]]:
        """The cells of a column, without quotes, with their lines; empty where a row is too short."""
        index = self.columns[column]
        for number, line in self._rows():
            cells = line.replace('"', "").split(self.separator, index + 1)
            yield number, cells[index].strip() if index < len(cells) else ""

    def _rows(self) -> Iterator[tuple[int, str]]:
        stripped = ((number, line.strip(" ")) for number, line in lines_of(self.path, after=self.header))
        rows = ((number, line) for number, line in stripped if line.strip() and not line.startswith("#"))
        return ((number, flattened(line, self.separator)) for number, line in rows) if self.vectors else rows

    def trajectory(self, name: str) -> Trajectory:
        """The columns t, x, y, z, qw, qx, qy, qz and, if there, scale."""
        names = ["t", "x", "y", "z", "qw", "qx", "qy", "qz", "scale"]
        numbers = self.parse([name for name in names if name in self.columns])
        scales = numbers[:, 8] if "scale" in self.columns and np.any(numbers[:, 8] != 1.0) else None
        return Trajectory(name, numbers[:, 0], Poses(numbers[:, 1:4], numbers[:, 4:8], scales))


def encoding_of(head: bytes) -> str:
    """UTF-8 or, where the byte order mark says so, UTF-16."""
    return "utf-16" if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"


def read_text(path: Path, largest: int = LARGEST_FILE) -> str:
    """The text of the file, its line ends made `\\n`.

    Raises
    ------
    TrajectoryError
        Where the file is no text, or has more bytes than the largest that is allowed.
    """
    return "".join(_pieces(path, largest))


def lines_of(path: Path, after: int = 0) -> Iterator[tuple[int, str]]:
    """The lines of the file, without their ends, and their numbers: all, or those after one.

    Raises
    ------
    TrajectoryError
        As `read_text`, and where a line is longer than any of a table.
    """
    number, begun = 0, ""
    for piece in _pieces(path, LARGEST_FILE):
        *lines, begun = (begun + piece).split("\n")
        if len(begun) > LONGEST_LINE:
            problem = f"this line is longer than {LONGEST_LINE} characters"
            raise TrajectoryError(path, problem, "name a file of rows", number + len(lines) + 1)
        for line in lines:
            number += 1
            if number > after:
                yield number, line
    if number >= after:
        yield number + 1, begun


def _pieces(path: Path, largest: int) -> Iterator[str]:
    """The text of the file piece by piece, its line ends made `\\n`."""
    lines = 0
    with path.open("rb") as file:
        size = path.stat().st_size
        if size > largest:
            problem = f"the file has {size >> 20} MiB, and {largest >> 20} can be read"
            raise TrajectoryError(path, problem, "split the recording, or export fewer bodies")
        decoder = codecs.getincrementaldecoder(encoding_of(file.read(2)))()
        decoder = io.IncrementalNewlineDecoder(decoder, translate=True)
        file.seek(0)
        data = b"start"
        while data:
            data = file.read(PIECE)
            try:
                piece = decoder.decode(data, final=not data)
            except UnicodeDecodeError as error:
                line = lines + error.object.count(b"\n", 0, error.start) + 1
                problem = f"this is not text (byte 0x{error.object[error.start]:02x})"
                raise TrajectoryError(path, problem, "save the file as UTF-8", line) from None
            if "\0" in piece:
                line = lines + piece.count("\n", 0, piece.index("\0")) + 1
                raise TrajectoryError(path, "this is not text but binary data", "name a text file", line)
            lines += piece.count("\n")
            yield piece


def cells_of(path: Path, number: int, line: str, separator: str | None) -> list[str]:
    """The cells of a header's line, without quotes and surrounding blanks."""
    if line.count(separator or " ") >= MOST_COLUMNS:
        raise TrajectoryError(path, f"more than {MOST_COLUMNS} columns", "export fewer bodies", number)
    if separator is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error as error:
        raise TrajectoryError(path, f"this line is no header ({error})", "name a file of columns", number) from None


@dataclass(frozen=True)
class HeaderLine:
    """A line that may name the columns."""

    number: int
    separator: str | None
    cells: list[str]

    vectors: bool = False
    """Whether cells of the rows hold vectors, and the names of the header are those of their numbers."""

    def of_rows(self, path: Path) -> HeaderLine:
        """Return the header as the first row below it has it."""
        rows = (line for _, line in lines_of(path, after=self.number) if line.strip() and not line.startswith("#"))
        names = expanded(self.cells, next(rows, ""), self.separator)
        return self if names is None else HeaderLine(self.number, self.separator, names, vectors=True)


def header_lines(path: Path) -> Iterator[HeaderLine]:
    """The lines that may name the columns: comments, as `numpy.savetxt` and EuRoC have it, and the first line behind.

    The last one is that line, without cells where there are only comments. Blank lines are skipped, and so is what
    tells spreadsheets the separator (`sep=;`).

    Raises
    ------
    TrajectoryError
        Where the file is empty.
    """
    number = comments = 0
    for number, line in lines_of(path):
        text = line.strip()
        if not text or text.lower().startswith("sep="):
            continue
        header = text.lstrip("# \t")
        separator = _separator_of(header)
        yield HeaderLine(number, separator, cells_of(path, number, header, separator))
        comments += 1
        if not text.startswith("#") or comments > MOST_COMMENTS:
            return
    if not comments:
        raise TrajectoryError(path, "the file is empty", "it needs a line that names its columns, and rows")
    yield HeaderLine(number, None, [])


def lines_above_numbers(path: Path) -> Iterator[HeaderLine]:
    """The lines near the beginning that a row of numbers with as many cells follows, and that hold none themselves.

    A row is one of numbers where more than half of the cells that are not empty are some. Blank lines are skipped.
    """
    above: HeaderLine | None = None
    for number, line in islice(lines_of(path), MOST_METADATA):
        text = line.strip().lstrip("# \t")
        if not text:
            continue
        if above and _are_numbers(cells := cells_of(path, number, text, above.separator), above.separator):
            if len(cells) == len(above.cells) and not any(map(is_number, above.cells)):
                yield above
            above = None
        else:
            separator = _separator_of(text)
            above = HeaderLine(number, separator, cells_of(path, number, text, separator))


def _are_numbers(cells: Sequence[str], separator: str | None) -> bool:
    filled = [cell if separator == "," else cell.replace(",", ".") for cell in cells if cell]
    return sum(map(is_number, filled)) > len(filled) / 2


def _separator_of(header: str) -> str | None:
    return max(SEPARATORS, key=header.count) if any(mark in header for mark in SEPARATORS) else None


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
    The header is one of `header_lines`. Blank lines and comments (`#`) between the rows are skipped.
    """
    expected = ", ".join(aliases[0] for aliases in names.values())
    partial: tuple[int, list[str]] | None = None
    first = 0
    for line in header_lines(path):
        first = line.number
        cells = [cell.partition("[")[0].strip().lower() for cell in line.cells]
        meanings = [_meaning_of(cell, {**names, **optional}) for cell in cells]
        columns = {meaning: index for index, meaning in enumerate(meanings) if meaning}
        missing = [meaning for meaning in names if meaning not in columns]
        if not missing:
            if repeated := [meaning for meaning in columns if meanings.count(meaning) > 1]:
                raise TrajectoryError(path, f"two columns mean {repeated[0]}", "rename or delete one of them", first)
            return Table(path, line.separator, columns, len(cells), first)
        if columns and (partial is None or len(missing) < len(partial[1])):
            partial = first, missing
    if default and not (partial and partial[0] == first):
        columns = {meaning: index for index, meaning in enumerate(default)}
        return Table(path, None, columns, len(default), first - 1)
    if partial is None:
        raise TrajectoryError(path, "no column has a known name", f"the first line has to name {expected}", first)
    number, missing = partial
    absent = ", ".join(names[meaning][0] for meaning in missing)
    raise TrajectoryError(path, f"no column named {absent}", f"the header has to name {expected}", number)


def _meaning_of(cell: str, names: Columns) -> str | None:
    return next((meaning for meaning, aliases in names.items() if cell in aliases), None)


def parse_rows(
    path: Path,
    rows: Iterable[tuple[int, str]],
    separator: str | None,
    columns: Mapping[str, int],
    width: int,
    dtype: type = np.float64,
    *,
    needed: int = 0,
) -> np.ndarray:
    """The numbers of some columns.

    Parameters
    ----------
    path : Path
        For the errors.
    rows : iterable of (line number, line)
    separator : str or None
        None means white space. Where it is not a comma, a comma is taken as the decimal sign.
    columns : mapping from name to index
        Which columns, in which order.
    width : int
        How many cells a row may have. Empty ones beyond are no matter; too few matter where a wanted one is missing.
    dtype : type
        Of the result.
    needed : int
        How many cells a row has to have; all up to the last wanted one in any case.

    Returns
    -------
    array, shape (rows, columns)
        Empty cells are NaN.

    Raises
    ------
    TrajectoryError
        With the number of the line.
    """
    rows, blocks, count = iter(rows), [np.empty((0, len(columns)), dtype)], 0
    while block := list(islice(rows, BLOCK)):
        count += len(block)
        if count > MOST_ROWS:
            problem = f"more than {MOST_ROWS} rows"
            raise TrajectoryError(path, problem, "split the recording, or export it at a lower rate", block[-1][0])
        blocks.append(_parse_block(path, block, separator, columns, width, dtype, needed))
    return np.concatenate(blocks)


def _parse_block(
    path: Path,
    rows: Sequence[tuple[int, str]],
    separator: str | None,
    columns: Mapping[str, int],
    width: int,
    dtype: type,
    needed: int,
) -> np.ndarray:
    needed = max(needed, *(index + 1 for index in columns.values()))
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
