"""Tables in files: rows of one kind, a dataclass whose fields are the columns. `float` reads back what was computed."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import astuple, fields
from pathlib import Path
from typing import TypeVar

from scripts.files import replacing

Row = TypeVar("Row")

READERS = {"str": str, "int": int, "float": float}


def write_rows(path: Path, kind: type[Row], rows: Iterable[Row]) -> None:
    """Write a header and the rows; None is an empty cell."""
    with replacing(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(field.name for field in fields(kind))
        writer.writerows(astuple(row) for row in rows)


def read_rows(path: Path, kind: type[Row]) -> list[Row]:
    """Read what `write_rows` wrote."""
    with path.open(encoding="utf-8", newline="") as stream:
        lines = list(csv.reader(stream))[1:]
    readers = [READERS[field.type] for field in fields(kind)]
    return [kind(*(read(cell) for read, cell in zip(readers, line, strict=True))) for line in lines]
