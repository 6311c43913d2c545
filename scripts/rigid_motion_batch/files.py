"""Atomic writing of files: a file is written under a temporary name next to its place, and moved there when complete.

Text is UTF-8 with LF line ends on every system, so that two runs can be compared byte by byte. A table has rows of one
dataclass whose fields are the columns; `float` reads back exactly the computed numbers.
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
"""The longest suffix that a temporary name keeps, in bytes."""


@contextmanager
def written_beside(path: Path, *, overwrite: bool = True) -> Iterator[Path]:
    """Yield a path next to `path` for a file that replaces it when the block ends well, and vanishes otherwise.

    The temporary path has the suffix of `path`, and a short name even if that of `path` is long. Missing folders are
    created.

    Raises
    ------
    FileExistsError
        Without `overwrite`, if a file exists at `path` by then; it stays.
    OSError
        If the folder cannot be written, or (on Windows) another program has `path` open. The error names `path`, not
        the temporary file.
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
        # The first error is the one that matters.
        with suppress(OSError):
            beside.unlink()
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError) and error.filename == str(beside):
            error.filename, error.filename2 = str(path), None
        raise


def ending_beside(path: Path) -> str:
    """Return the ending of temporary names next to a path: a digest of its name, and its suffix."""
    suffix = path.suffix if len(os.fsencode(path.suffix)) <= LONGEST_SUFFIX else ""
    return f".{zlib.crc32(os.fsencode(path.name)):08x}{suffix}"


def _make_folders(folder: Path) -> list[Path]:
    """Create a folder, and return the folders that were missing on the way, the outermost first."""
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
    """Move a file to a free path. Raises FileExistsError if the path is taken."""
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:  # This file system has no hard links: reserve the name first, then replace it.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL))
        source.replace(target)
    else:
        source.unlink()


@contextmanager
def replacing(path: Path) -> Iterator[TextIOWrapper]:
    """Open a text file that replaces `path` when the block ends well: see `written_beside`."""
    with written_beside(path) as beside, beside.open("w", encoding="utf-8", newline="\n") as stream:
        yield stream


def write_text(path: Path, text: str) -> None:
    """Write a whole text file, or nothing."""
    with replacing(path) as stream:
        stream.write(text)


def append_lines(path: Path, lines: Iterable[Mapping[str, Any]]) -> None:
    """Append objects to a file as lines of JSON. If two processes append at the same time, each line stays whole."""
    text = "".join(f"{json.dumps(line)}\n" for line in lines)
    path.parent.mkdir(exist_ok=True)
    # Windows would write CR LF for LF.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
    opened = os.open(path, flags, 0o666)
    try:
        os.write(opened, f"\n{text}".encode())  # This ends a line that was cut off.
    finally:
        os.close(opened)


def lines_of(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the objects of a file of JSON lines; skip damaged lines."""
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
"""Characters that spreadsheets take for the start of a formula: names come from files of strangers."""


def escaped(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula: an apostrophe is added where needed."""
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def line_of(cells: Iterable[object]) -> str:
    """Return cells as a line of CSV that ends with LF; texts are `escaped`."""
    line = io.StringIO()
    cells = [escaped(cell) if isinstance(cell, str) else cell for cell in cells]
    # Before Python 3.13, csv quotes only the line ends that it writes itself. A joint's name may contain any.
    csv.writer(line, lineterminator="\r\n").writerow(cells)
    return f"{line.getvalue()[:-2]}\n"


def write_rows(path: Path, kind: type[Row], rows: Iterable[Row]) -> None:
    """Write a header and the rows; None becomes an empty cell."""
    with replacing(path) as stream:
        stream.write(line_of(field.name for field in fields(kind)))
        for row in rows:
            stream.write(line_of(astuple(row)))
