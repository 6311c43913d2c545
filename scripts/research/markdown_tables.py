"""The tables of a page of Markdown, as this program's scripts write them, read again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

NUMBER = re.compile(r"[-\N{MINUS SIGN}+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Table:
    """A table, and where it stands."""

    section: str
    """The heading above it."""

    title: str
    """The line above it where that is bold, without the asterisks; else empty."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def row(self, *cells: str) -> tuple[str, ...]:
        """The first row that begins with these cells.

        Raises
        ------
        LookupError
            Where there is none.
        """
        for row in self.rows:
            if row[: len(cells)] == cells:
                return row
        raise LookupError(f"{self.section!r} has no row {' | '.join(cells)!r}")

    def column(self, name: str) -> list[str]:
        """All cells below a head.

        Raises
        ------
        LookupError
            Where there is none of that name.
        """
        if name not in self.head:
            raise LookupError(f"{self.section!r} has no column {name!r}")
        place = self.head.index(name)
        return [row[place] for row in self.rows]


def tables(page: str) -> Iterator[Table]:
    """All tables of a page."""
    section = title = ""
    head: tuple[str, ...] = ()
    rows: list[tuple[str, ...]] = []
    for line in [*page.splitlines(), ""]:
        if line.startswith("|"):
            cells = tuple(cell.strip() for cell in line.strip().strip("|").split("|"))
            if not head:
                head = cells
            elif not all(re.fullmatch(":?-+:?", cell) for cell in cells):
                rows.append(cells)
            continue
        if head:
            yield Table(section, title, head, tuple(rows))
            head, rows, title = (), [], ""
        if line.startswith("#"):
            section, title = line.lstrip("#").strip(), ""
        elif line:
            title = line[2:-2] if line.startswith("**") and line.endswith("**") else ""


def tables_of(page: str, section: str) -> list[Table]:
    """Those whose heading begins so.

    Raises
    ------
    LookupError
        Where there are none.
    """
    found = [one for one in tables(page) if one.section.startswith(section)]
    if not found:
        raise LookupError(f"no table in a section {section!r}")
    return found


def titled(page: str, title: str) -> Table:
    """The table below this bold line.

    Raises
    ------
    LookupError
        Where there is none.
    """
    for one in tables(page):
        if one.title == title:
            return one
    raise LookupError(f"no table below {title!r}")


def numbers(cell: str) -> list[float]:
    """The numbers in a cell, in their order."""
    return [float(found.replace("\N{MINUS SIGN}", "-")) for found in NUMBER.findall(cell)]


def first_numbers(cells: Sequence[str]) -> list[float]:
    """The first number of each cell that has any."""
    return [found[0] for found in map(numbers, cells) if found]
