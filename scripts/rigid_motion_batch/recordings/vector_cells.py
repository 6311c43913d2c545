"""Cells that hold a whole vector or quaternion, as Unity prints them: `(0.1, 0.2, 0.3)`, `"0.1, 0.2, 0.3"`.

A row of such cells becomes one of numbers, and its header one with a name for each: `Position` becomes `Position.x`,
`Position.y` and `Position.z`. Four numbers are x, y, z, w. A comma with a blank behind it is no decimal one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

CELL = re.compile(r'"?[(\[{]([^()\[\]{}"]*)[)\]}]"?|"([^"]*)"')
NAMED = re.compile(r"^[xyzw]\s*[=:]\s*", re.IGNORECASE)
"""Pattern of what is in front of a number, as Unreal writes it: X=0.1 Y=0.2 Z=0.3."""

AXES = "xyzw"


def flattened(line: str, separator: str | None) -> str:
    """Return a row in which every number has a cell of its own, and no other cell a separator inside."""
    between = separator or " "

    def flat(match: re.Match[str]) -> str:
        return between.join(_numbers(match)) or match[0].replace('"', "").replace(between, " ")

    return CELL.sub(flat, line)


def expanded(names: Sequence[str], line: str, separator: str | None) -> list[str] | None:
    """Return the names of a row's columns once it is flattened; None where none of its cells holds several numbers."""
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
    """Return the number in a cell, or the three or four of them; none where it holds anything else."""
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
