"""Writing of changed numbers into a copy of a recording, with everything else unchanged."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

import numpy as np

from rigid_motion.motion.eulers import extrinsic_eulers_from_quaternions

from .tables import CELL, HeaderLine

WRITTEN_DECIMALS = 9
"""Decimals of written numbers: nanometres if lengths are metres."""

ENCODINGS = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
"""Encodings by byte order mark. The mark stays in the text, and so is written again."""

POINT, COMMA = (re.compile(rf"[-+]?(?:\d+{mark}?\d*|{mark}\d+)(?:[eE][-+]?\d+)?") for mark in (r"\.", ","))
"""Patterns of the numbers in a vector."""


def eulers_near(quaternions: np.ndarray, order: str, near: np.ndarray) -> np.ndarray:
    """Return intrinsic Euler angles (n, 3) of rotations (n, 4) about the axes in `order`.

    Of all angles of the same rotation, those nearest to `near` (n, 3) are returned, all in radians.
    """
    angles = extrinsic_eulers_from_quaternions(quaternions, order[::-1])[:, ["XYZ".index(axis) for axis in order]]
    other = np.array([np.pi, np.pi, np.pi]) + angles * (1.0, -1.0, 1.0)
    apart = np.stack([angles, other]) - near
    apart -= 2.0 * np.pi * np.rint(apart / (2.0 * np.pi))
    first = np.abs(apart[0]).sum(axis=1) <= np.abs(apart[1]).sum(axis=1)
    return near + np.where(first[:, None], apart[0], apart[1])


def write_text(header: HeaderLine, target: Path, numbers: np.ndarray) -> None:
    """Write the file of a header to a path, with other numbers (rows, columns); NaN keeps the present number."""
    changed = np.isfinite(numbers).any(axis=1)
    rows = {line: numbers[row] for row, (line, _) in enumerate(header.rows()) if changed[row]}
    with header.path.open("rb") as head:
        encoding = ENCODINGS.get(head.read(2), "utf-8")
    separator = None if header.shift else header.separator
    with (
        header.path.open(encoding=encoding, newline="") as file,
        target.open("w", encoding=encoding, newline="") as written,
    ):
        for number, text in enumerate(file, 1):
            if number not in rows:
                written.write(text)
                continue
            pieces, done = [], 0
            spans = _spans(text.rstrip("\r\n"), separator, header.vectors)
            for value, (begin, end) in zip(rows[number][header.shift :], spans, strict=False):
                if np.isfinite(value):
                    pieces += [text[done:begin], _text(value, text[begin:end], separator)]
                    done = end
            written.write("".join([*pieces, text[done:]]))


def _text(value: float, before: str, separator: str | None) -> str:
    text = f"{value:.{WRITTEN_DECIMALS}f}".rstrip("0").rstrip(".")
    return text.replace(".", ",") if "," in before and separator != "," else text


def _spans(line: str, separator: str | None, vectors: bool) -> list[tuple[int, int]]:
    """Return the start and end of each cell of a line; the numbers of a vector count as cells."""
    between = re.escape(separator) if separator else r"\s"
    whole = rf"(?:{CELL.pattern}|[^{between}])+" if vectors else rf'(?:"[^"]*"|[^{between}])+'
    if separator:
        whole = rf"(?:^|(?<={between}))(?:{whole})?(?=[{between}]|$)"
    result = []
    for cell in re.finditer(whole, line):
        number = COMMA if "." not in cell[0] and re.search(r";|,\s", cell[0]) else POINT
        inside = [*number.finditer(cell[0])] if vectors else []
        own = inside if len(inside) in (3, 4) else [re.search(r'[^\s"].*[^\s"]|[^\s"]|$', cell[0])]
        result += [(cell.start() + one.start(), cell.start() + one.end()) for one in own if one]
    return result
