"""Text files of numbers: lines, named columns and rows.

Files are read piece by piece, so that numbers and not text take memory. Nothing that a file states about itself is
trusted before it has been read.

A cell may hold a whole vector or quaternion, as Unity prints them: `(0.1, 0.2, 0.3)`, `"0.1, 0.2, 0.3"`. Such a cell is
split into numbers, and its header into a name for each: `Position` becomes `Position.x`, `Position.y` and `Position.z`.
Four numbers are x, y, z, w. A comma followed by a blank is not a decimal comma.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from operator import itemgetter
from pathlib import Path

import numpy as np

from .clips import ClipWarning
from .column_names import UNIT_OF, ColumnName
from .recordings import TrajectoryError, shown

SEPARATORS = (",", ";", "\t")

BLANK_CHARACTERS = " \t,;\r\v\f"
"""Characters of a row without numbers."""

UNITS_BELOW = {"", "-", "1", *UNIT_OF}
"""Cells of a row of units below the names."""

LARGEST_FILE = 1 << 30
"""Bytes. Larger files are refused: an hour of a hundred bodies at 90 Hz has half as many."""

MOST_ROWS = 20_000_000
"""Rows; files with more are refused: two days at 100 Hz."""

LONGEST_LINE = 1 << 22
"""Characters. A file with longer lines is not a table."""

MOST_COLUMNS = 100_000
"""Columns; ten thousand bodies have fewer."""

PIECE_BYTES = 1 << 18
"""Bytes read at once."""

BLOCK_ROWS = 1 << 14
"""Rows parsed at once."""

DAMAGED_ADVICE = "delete this line if it is damaged, as the last one of a recording that was cut off"
"""Advice for a line that differs from the others."""

MOST_COMMENTS = 100
"""Lines of comments before the header."""

MOST_METADATA = 50
"""Lines within which a header may follow other lines."""


def encoding_of(head: bytes) -> str:
    """Return UTF-8 or, if there is its byte order mark, UTF-16."""
    return "utf-16" if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"


def read_text(path: Path, largest: int = LARGEST_FILE) -> str:
    r"""Read the text of a file, with line ends converted to `\n`.

    Raises
    ------
    TrajectoryError
        If the file is not text, or has more than `largest` bytes.
    """
    return "".join(_pieces(path, largest))


def lines_of(path: Path, after: int = 0) -> Iterator[tuple[int, str]]:
    """Yield the numbers and lines of a file, without line ends: all lines, or those after one.

    Raises
    ------
    TrajectoryError
        As in `read_text`, and if a line is too long for a table.
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
    r"""Yield the text of a file piece by piece, with line ends converted to `\n`."""
    lines = 0
    with path.open("rb") as file:
        size = path.stat().st_size
        if size > largest:
            problem = f"the file has {size >> 20} MiB, and {largest >> 20} can be read"
            raise TrajectoryError(path, problem, "split the recording, or export fewer bodies")
        encoding = encoding_of(file.read(2))
        decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)(), translate=True)
        file.seek(0)
        data = b"start"
        while data:
            data = file.read(PIECE_BYTES)
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
    """Return the cells of a header line, without quotes and surrounding blanks."""
    if line.count(separator or " ") >= MOST_COLUMNS:
        raise TrajectoryError(path, f"more than {MOST_COLUMNS} columns", "export fewer bodies", number)
    if separator is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error as error:
        raise TrajectoryError(path, f"this line is not a header ({error})", "name a file of columns", number) from None


@dataclass(frozen=True)
class HeaderLine:
    """A line that may name the columns."""

    path: Path
    number: int
    separator: str | None
    """Separator of the cells; None means white space."""

    cells: list[str]

    vectors: bool = False
    """True if cells of the rows hold vectors; `cells` then has a name for each of their numbers."""

    names: Sequence[ColumnName | None] | None = None
    """Meanings of the columns, if the format defines them instead of the cells."""

    rows_of: Callable[[Iterator[tuple[int, str]]], Iterable[tuple[int, str]]] | None = None
    """A function that makes rows from the lines below, if not every line is a row."""

    inverted: bool = False
    """True if the poses are those of the world relative to a camera."""

    axes: str = ""
    """The axes of the program that wrote the file, if known: a name in `axes.DESCRIBED`."""

    advice: str = ""
    """The way out for missing columns, if naming them is not."""

    remark: str = ""
    """A remark on how the file is read."""

    warnings: tuple[ClipWarning, ...] = ()

    shift: int = 0
    """Number of cells at the start of a row that the line in the file lacks."""

    write: Callable[[Path, np.ndarray], None] | None = None
    """A function that writes the file with other numbers, if lines are not rows."""

    @classmethod
    def of(cls, path: Path, number: int, text: str) -> HeaderLine:
        """Return the header made of a line, which may be a comment."""
        text = text.lstrip("# \t")
        separator = max(SEPARATORS, key=text.count) if any(mark in text for mark in SEPARATORS) else None
        return cls(path, number, separator, cells_of(path, number, text, separator))

    def error(self, problem: str, way_out: str) -> TrajectoryError:
        """Return an error for this line."""
        return TrajectoryError(self.path, problem, way_out, self.number)

    def rows(self) -> Iterator[tuple[int, str]]:
        """Yield the numbers and lines of the rows below, without blank lines and comments."""
        lines = lines_of(self.path, after=self.number)
        for number, line in self.rows_of(lines) if self.rows_of else lines:
            line = line.strip(" ")
            if line.strip(BLANK_CHARACTERS) and line[0] != "#":
                yield number, flattened(line, self.separator) if self.vectors else line

    def cells_below(self, column: int) -> Iterator[tuple[int, str]]:
        """Yield the line number and cell of a column in each row, without quotes; empty if the row is too short."""
        for number, line in self.rows():
            cells = split_row(line, self.separator)
            yield number, cells[column].strip() if column < len(cells) else ""

    def numbers_below(self, columns: Mapping[str, int]) -> np.ndarray:
        """Return the numbers of columns, shape (rows, columns). Empty cells are NaN. Errors use the names in `columns`.

        If the separator is not a comma, commas are decimal. Empty cells beyond the header are ignored. Missing cells
        are an error only if a requested one is missing. Raises TrajectoryError with the line.
        """
        path, separator, width = self.path, self.separator, len(self.cells)
        indices = [*columns.values()]
        needed = max(indices) + 1
        pick = itemgetter(*indices) if len(indices) > 1 else lambda cells: [cells[indices[0]]]
        rows, count = self.rows(), 0
        blocks: list[np.ndarray] = [np.empty((0, len(columns)))]
        while block := list(islice(rows, BLOCK_ROWS)):
            count += len(block)
            if count > MOST_ROWS:
                problem = f"more than {MOST_ROWS} rows"
                raise TrajectoryError(path, problem, "split the recording, or export it at a lower rate", block[-1][0])
            numbers = []
            for number, line in block:
                if separator != "," and "," in line:
                    line = line.replace(",", ".")
                cells = split_row(line, separator)
                if len(cells) > width and any(cell.strip() for cell in cells[width:]):
                    problem = f"{len(cells)} columns where {width} have a name"
                    way_out = "give all columns a name, or delete this line where it alone has more"
                    raise TrajectoryError(path, problem, way_out, number)
                if len(cells) < needed:
                    problem = f"{len(cells)} columns where {needed} are needed"
                    raise TrajectoryError(path, problem, DAMAGED_ADVICE, number)
                try:
                    if "_" in line:
                        raise ValueError("Python's own way of writing numbers")
                    numbers.append([*map(float, pick(cells))])
                except ValueError:
                    named = zip(columns, pick(cells), strict=True)
                    numbers.append([_number(path, number, name, cell) for name, cell in named])
            blocks.append(np.array(numbers))
        return np.concatenate(blocks)

    def of_rows(self) -> HeaderLine:
        """Return the header with names adapted to vectors in the first row below, or to a row of units."""
        below = ((number, line.strip()) for number, line in islice(lines_of(self.path, self.number), MOST_COMMENTS))
        number, row = next(((number, line) for number, line in below if line and line[0] != "#"), (0, ""))
        units = [cell.strip().strip("[]()") for cell in split_row(row, self.separator)]
        if len(units) == len(self.cells) and any(units) and all(unit in UNITS_BELOW for unit in units):
            cells = [f"{cell} [{unit}]" if unit else cell for cell, unit in zip(self.cells, units, strict=True)]
            return replace(self, number=number, cells=cells)
        names = expanded(self.cells, row, self.separator)
        return self if names is None else replace(self, cells=names, vectors=True)


def header_lines(path: Path) -> Iterator[HeaderLine]:
    """Yield lines that may name the columns: comments, as by `numpy.savetxt` and EuRoC, and the first line after them.

    The last one is that line, or has no cells if there are only comments. Blank lines are skipped, as is the line that
    tells spreadsheets the separator (`sep=;`). Raises TrajectoryError if the file is empty.
    """
    number = comments = 0
    for number, line in lines_of(path):
        text = line.strip()
        if text and not text.lower().startswith("sep="):
            yield HeaderLine.of(path, number, text)
            comments += 1
            if not text.startswith("#") or comments > MOST_COMMENTS:
                return
    if not comments:
        raise TrajectoryError(path, "the file is empty", "it needs a line that names its columns, and rows")
    yield HeaderLine(path, number, None, [])


def lines_of_words(path: Path, after: int) -> Iterator[HeaderLine]:
    """Yield lines after the line `after`, near the beginning, that hold no numbers. Blank lines are skipped."""
    for number, line in islice(lines_of(path, after=after), max(MOST_METADATA - after, 0)):
        header = HeaderLine.of(path, number, line.strip())
        if header.cells and not any(map(is_number, header.cells)):
            yield header


def split_row(line: str, separator: str | None) -> list[str]:
    """Return the cells of a row, without quotes."""
    if '"' in line and separator:
        with suppress(csv.Error):  # a cell that is larger than any number
            return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return line.replace('"', "").split(separator)


def _number(path: Path, line: int, name: str, cell: str) -> float:
    """Return the number in a cell, which may be empty (NaN) or have a decimal comma in quotes."""
    try:
        if not cell.strip(" "):
            return np.nan
        if "_" in cell:
            raise ValueError
        return float(cell.replace(",", "."))
    except ValueError:
        problem = f"{name} is {shown(cell.strip())}, not a number"
        raise TrajectoryError(path, problem, DAMAGED_ADVICE, line) from None


CELL = re.compile(r'"?[(\[{]([^()\[\]{}"]*)[)\]}]"?|"([^"]*)"')
NAMED = re.compile(r"^[xyzw]\s*[=:]\s*", re.IGNORECASE)
"""Pattern of the name before a number, as in Unreal: X=0.1 Y=0.2 Z=0.3."""

AXES = "xyzw"


def flattened(line: str, separator: str | None) -> str:
    """Return a row with each number of a vector in its own cell, and without separators inside other cells."""
    between = separator or " "

    def flat(match: re.Match[str]) -> str:
        return between.join(_numbers(match)) or match[0].replace('"', "").replace(between, " ")

    return CELL.sub(flat, line)


def expanded(names: Sequence[str], line: str, separator: str | None) -> list[str] | None:
    """Return the column names for a flattened row; None if none of its cells holds several numbers."""
    sizes: list[int] = []

    def mark(match: re.Match[str]) -> str:
        sizes.append(len(_numbers(match)))
        return f"<{sizes[-1]}>"

    cells = CELL.sub(mark, line).split(separator)
    if max(sizes, default=0) < 3 or len(cells) > len(names):
        return None
    result = [re.fullmatch(r"\s*<([34])>\s*", cell) for cell in cells] + [None] * (len(names) - len(cells))
    return [
        text
        for name, size in zip(names, result, strict=True)
        for text in ([f"{name}.{axis}" for axis in AXES[: int(size[1])]] if size else [name])
    ]


def _numbers(match: re.Match[str]) -> list[str]:
    """Return the one, three or four numbers in a cell, as texts; empty if it holds anything else."""
    text = (match[1] if match[1] is not None else match[2]).strip()
    if ";" in text:
        parts = text.split(";")
    elif re.search(r",\s", text):
        parts = re.split(r",\s+", text)
    else:
        parts = text.split("," if text.count(",") > 1 else None)
    parts = [NAMED.sub("", part.strip()).replace(",", ".") for part in parts]
    return parts if len(parts) in (1, 3, 4) and all(map(is_number, parts)) else []


def is_number(cell: str) -> bool:
    """Return whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True
