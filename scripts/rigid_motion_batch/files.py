"""Files that are whole or not there: written beside their place, under a name of their own, and moved into it.

Text is UTF-8 with LF line ends on every system, so that two runs can be compared byte by byte. A table
has rows of one kind, a dataclass whose fields are the columns; `float` reads back what was computed.
"""

from __future__ import annotations

import csv
import io
import json
import os
import secrets
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import astuple, fields
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rigid_motion_batch.supervising import report

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST_SUFFIX = 8
"""Bytes of a suffix that is kept."""


@contextmanager
def written_beside(path: Path, *, overwrite: bool = True) -> Iterator[Path]:
    """Yield a path next to `path` for a file that takes its place when the block ends well,
    and leaves no trace otherwise.

    It ends as `path` does, and is short however long that is. Folders that are missing on the way are made.

    Raises
    ------
    FileExistsError
        Without `overwrite`, where there is something at `path` by then; it stays.
    OSError
        Where the folder cannot be written, or (on Windows) another program has `path` open. It names `path`, and not
        what is written meanwhile.
    """
    made = _make_folders(path.parent)
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    beside = target.with_name(f".{secrets.token_hex(4)}{ending_beside(target)}")
    report(making=os.path.abspath(beside))
    try:
        yield beside
        if overwrite:
            beside.replace(target)
        else:
            _move_to_free(beside, path)
    except BaseException as error:
        # What went wrong before is what counts.
        with suppress(OSError):
            beside.unlink()
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError) and error.filename == str(beside):
            error.filename, error.filename2 = str(path), None
        raise


def ending_beside(path: Path) -> str:
    """Return what the names of files that are written beside a path end with: a digest of its name, and its suffix."""
    suffix = path.suffix if len(os.fsencode(path.suffix)) <= LONGEST_SUFFIX else ""
    return f".{zlib.crc32(os.fsencode(path.name)):08x}{suffix}"


def _make_folders(folder: Path) -> list[Path]:
    """Make a folder, and return those that were missing on the way, the outermost first."""
    made: list[Path] = []
    while not os.path.isdir(folder) and folder != folder.parent:
        made.insert(0, folder)
        folder = folder.parent
    if made:
        for item in made:
            report(making=os.path.abspath(item))
        made[-1].mkdir(parents=True, exist_ok=True)
    return made


def _move_to_free(source: Path, target: Path) -> None:
    """Move a file to a path where there is nothing. Raises FileExistsError where there is something."""
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:  # This file system has no hard links: the name is taken first, and then what is to be there.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL))
        source.replace(target)
    else:
        source.unlink()


@contextmanager
def replacing(path: Path) -> Iterator[TextIOWrapper]:
    """Open a text file that takes the place of `path` when the block ends well: see `written_beside`."""
    with written_beside(path) as beside, beside.open("w", encoding="utf-8", newline="\n") as stream:
        yield stream


def write_text(path: Path, text: str) -> None:
    """Write all of a text file, or nothing of it."""
    with replacing(path) as stream:
        stream.write(text)


def append_lines(path: Path, lines: Iterable[Mapping[str, Any]]) -> None:
    """Add objects to a file with a line of JSON for each: of two who do so at the same time each line stays whole."""
    text = "".join(f"{json.dumps(line)}\n" for line in lines)
    path.parent.mkdir(exist_ok=True)
    # Windows would write CR LF for LF.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
    opened = os.open(path, flags, 0o666)
    try:
        os.write(opened, f"\n{text}".encode())  # A line that was cut off ends here.
    finally:
        os.close(opened)


def lines_of(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the objects of such a file; lines that are damaged are left out."""
    try:
        text = path.read_bytes()
    except OSError:
        return
    for line in text.splitlines():
        with suppress(ValueError, RecursionError):
            if isinstance(content := json.loads(line), dict):
                yield content


Row = TypeVar("Row", bound="DataclassInstance")

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters that spreadsheets take for the beginning of a formula, if a text begins with it: names come from
strangers' files."""


def escaped(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula: with an apostrophe before it, where it would be one."""
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def line_of(cells: Iterable[object]) -> str:
    """Return cells as a line of CSV, which ends with LF; texts are `escaped`."""
    line = io.StringIO()
    cells = [escaped(cell) if isinstance(cell, str) else cell for cell in cells]
    # Before Python 3.13, csv quotes no ends of lines but those it writes itself. A joint's name may have any.
    csv.writer(line, lineterminator="\r\n").writerow(cells)
    return f"{line.getvalue()[:-2]}\n"


def write_rows(path: Path, kind: type[Row], rows: Iterable[Row]) -> None:
    """Write a header and the rows; None is an empty cell."""
    with replacing(path) as stream:
        stream.write(line_of(field.name for field in fields(kind)))
        for row in rows:
            stream.write(line_of(astuple(row)))
