"""Tables in files: rows of one kind, a dataclass whose fields are the columns. `float` reads back what was computed."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rigid_motion_batch.files import replacing

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

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
