"""Radii: how large the balls are in which no point is off by more than the shell error; in metres."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid_motion_batch.command_line import printable
from rigid_motion_batch.rows import unescaped

from .choices import METRES

RIGID, JOINT = 0.1, 0.03
"""Of what a hand holds, and of what is around a joint of a body."""

MOST_BYTES = 1 << 20
"""Of a table of radii."""


@dataclass(frozen=True)
class Radii:
    """Plain data, as parameters of tasks."""

    rigid: float = RIGID
    """Of a single rigid body."""

    joint: float = JOINT
    """Of every joint of a whole body that has none of its own."""

    named: tuple[tuple[str, float], ...] = ()
    """Joints by name, without blanks around it, and their radii."""

    def of(self, joints: Sequence[str]) -> np.ndarray:
        """Return the radii of these joints, shape (joints,)."""
        named = dict(self.named)
        return np.array([named.get(joint.strip(), self.joint) for joint in joints])

    def unknown(self, joints: Iterable[str]) -> list[str]:
        """Return the names that none of these joints has."""
        known = {joint.strip() for joint in joints}
        return [name for name, _ in self.named if name not in known]


EVERYWHERE = Radii()


def read_radii(text: str) -> Radii:
    """Return a radius for everything, or a table with the columns `joint` and `radius_m`.

    Raises
    ------
    ValueError
        With the line of the table, what is wrong, and the way out.
    """
    try:
        radius = radius_in_metres(text)
        return Radii(rigid=radius, joint=radius)
    except ValueError:
        # Not that of pathlib, for which a name that is too long for a file is an error.
        if not os.path.isfile(text):
            raise ValueError(
                f"{text!r} is neither a length above 0, such as 3cm or 0.03, nor a table of radii (CSV: joint,radius_m)"
            ) from None
    return Radii(named=tuple(_read_table(Path(text)).items()))


def _read_table(path: Path) -> dict[str, float]:
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise ValueError(f"{path}: more than {MOST_BYTES} bytes are no table of radii")
        reader = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""))
        lines = [(reader.line_num, cells) for cells in reader]
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from None
    except (UnicodeDecodeError, csv.Error):
        raise ValueError(f"{path}: this is no CSV in UTF-8; it needs the columns joint,radius_m") from None
    header = [name.strip().lower() for name in lines[0][1]] if lines else []
    if not {"joint", "radius_m"} <= set(header):
        result = printable(",".join(header))[:80] or "none"
        raise ValueError(f"{path}:1: the columns joint and radius_m are needed, and it has {result}")
    columns = header.index("joint"), header.index("radius_m")
    radii: dict[str, float] = {}
    for number, cells in lines[1:]:
        if not any(cells):
            continue
        if len(cells) <= max(columns):
            raise ValueError(f"{path}:{number}: {len(cells)} cells where {len(header)} are expected")
        joint, radius = unescaped(cells[columns[0]]).strip(), cells[columns[1]].strip()
        if joint in radii:
            raise ValueError(f"{path}:{number}: the joint {joint!r} comes a second time; leave one")
        try:
            radii[joint] = _above_zero(float(radius))
        except ValueError:
            raise ValueError(f"{path}:{number}: {radius!r} is no number of metres above 0") from None
    return radii


def radius_in_metres(text: str) -> float:
    """Return a radius as it is written: 3cm, 30mm, 0.03m, or 0.03. Raises ValueError where it is none above 0."""
    parts = re.fullmatch(rf"(.*?)\s*({'|'.join(METRES)})?\s*", text, re.DOTALL)
    assert parts is not None  # which any text fits
    number, unit = parts.groups()
    try:
        return _above_zero(float(number) * METRES[unit or "m"])
    except ValueError:
        raise ValueError(f"{text!r} is not a length above 0, such as 3cm or 0.03") from None


def _above_zero(radius: float) -> float:
    if not 0.0 < radius < math.inf:
        raise ValueError
    return radius
