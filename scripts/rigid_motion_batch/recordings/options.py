"""Options for reading a recording: column names, units, Euler order, and the part to read.

All are plain data, so that they can be sent with a task as JSON. Command lines have a group of options for them.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from rigid_motion_batch.axes import AXES
from rigid_motion_batch.command_line import number

TICKS_PER_S_BY_UNIT = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Units of time, and how many of each make a second."""

MEANINGS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz", "rx", "ry", "rz", "scale", "device")
"""Meanings of columns: time, position, quaternion, Euler angles about x, y and z, scale, and name of the row's body."""


@dataclass(frozen=True)
class ReadingOptions:
    """Options for reading a recording; unset ones are left to the file. Raises ValueError for invalid values."""

    columns: tuple[tuple[str, str], ...] = ()
    """Pairs of a name in `MEANINGS` and the column's name in the file. They override the meanings of names."""

    time_unit: str | None = None
    """A name in `TICKS_PER_S_BY_UNIT`: the unit of times, which overrides that of the file."""

    scale: float | None = None
    """Metres per unit of the positions, which overrides the unit of the file."""

    euler: str | None = None
    """The order of Euler angles, as in SciPy: "YXZ" about the moved axes (intrinsic), "zxy" about the world's axes
    (extrinsic). These two examples are the same rotation."""

    degrees: bool = False
    """True if angles are degrees, overriding their names. Otherwise, angles whose names state no unit are radians."""

    frame_rate: float | None = None
    """Frames a second, if the file counts frames instead of seconds."""

    start: float | None = None
    """Seconds after the first sample; earlier samples are left out. If set, an initial T-pose counts as motion."""

    end: float | None = None
    """Seconds after the first sample; later samples are left out."""

    clean: float | None = None
    """Metres by which cleaning may move a sample, 0 for no limit; None for no cleaning."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", tuple((meaning, column) for meaning, column in self.columns))
        meanings = [meaning for meaning, _ in self.columns]
        for meaning in meanings:
            if meaning not in MEANINGS:
                raise ValueError(f"a column cannot mean {meaning!r}; known are {', '.join(MEANINGS)}")
            if meanings.count(meaning) > 1:
                raise ValueError(f"two columns for {meaning}; name one")
        if self.time_unit is not None and self.time_unit not in TICKS_PER_S_BY_UNIT:
            raise ValueError(f"there is no unit of time {self.time_unit!r}; known are {', '.join(TICKS_PER_S_BY_UNIT)}")
        if self.scale is not None and not 0.0 < self.scale < math.inf:
            raise ValueError(f"a unit cannot be {self.scale} metres long; give a number such as 0.01 for centimetres")
        if self.euler is not None and sorted(self.euler) not in (list("XYZ"), list("xyz")):
            raise ValueError(
                f"{self.euler!r} is not an order of Euler angles; give the three axes once each, in capitals (YXZ) for "
                "turns about the moved axes, in small letters (zxy) about those of the world"
            )

        if self.frame_rate is not None and not 0.0 < self.frame_rate < math.inf:
            raise ValueError(f"there cannot be {self.frame_rate} frames a second; give a number such as 90")
        if self.frame_rate is not None and self.time_unit is not None:
            raise ValueError("--time-unit and --frame-rate exclude one another: times are in one of them")
        for name, seconds in (("start", self.start), ("end", self.end)):
            if seconds is not None and not 0.0 <= seconds < math.inf:
                raise ValueError(f"--{name} cannot be {seconds}: give seconds after the first sample, such as 2.5")
        if self.end is not None and self.end <= (self.start or 0.0):
            raise ValueError(f"--end {self.end:g} leaves nothing: it must be later than --start {self.start or 0:g}")

    @property
    def given(self) -> tuple[str, ...]:
        """The names of the fields that are set."""
        return tuple(name for name, value in vars(self).items() if not (value is None or value is False or value == ()))

    @property
    def intrinsic_order(self) -> str:
        """The order of turns about the moved axes: an extrinsic order reversed is the equal intrinsic one."""
        order = self.euler or ""
        return order if order.isupper() else order[::-1].upper()


AS_THE_FILE_SAYS = ReadingOptions()
"""Options with none set."""


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """Add the group of options that `reading_options` turns into `ReadingOptions`, and `--axes`."""
    group = parser.add_argument_group("reading", "For recordings that leave something out; docs/csv.md has examples.")
    group.add_argument(
        "--axes",
        type=str.lower,
        choices=AXES,
        help="axes of the recordings (those of the format, or blender)",
    )
    group.add_argument(
        "--columns",
        type=_columns,
        default=(),
        metavar="t=NAME,...",
        help="columns of CSVs by name: t, x, y, z, qx, qy, qz, qw, rx, ry, rz (Euler angles), scale, device",
    )
    group.add_argument("--time-unit", choices=TICKS_PER_S_BY_UNIT, help="unit of the times, overriding the file")
    group.add_argument(
        "--frame-rate",
        type=_field("frame_rate", number),
        metavar="HZ",
        help="frames a second, if a column counts frames, not seconds",
    )
    group.add_argument(
        "--scale", type=_field("scale", number), metavar="M", help="metres in a unit of length: 0.01 for centimetres"
    )
    group.add_argument(
        "--euler",
        type=_field("euler", str),
        metavar="ORDER",
        help="order of the Euler angles of CSVs: YXZ about the moved axes (intrinsic), zxy about the world's",
    )
    group.add_argument(
        "--degrees", action="store_true", help="the Euler angles are in degrees (as the columns' names say, or radians)"
    )
    group.add_argument(
        "--start",
        type=_field("start", number),
        metavar="S",
        help="begin this many seconds after the first sample; 0 keeps an initial T-pose",
    )
    group.add_argument(
        "--end", type=_field("end", number), metavar="S", help="end this many seconds after the first sample"
    )


def add_clean_option(parser: argparse._ActionsContainer) -> None:
    """Add --clean."""
    parser.add_argument(
        "--clean",
        nargs="?",
        const=0.0,
        type=_clean_length,
        metavar="LENGTH",
        help="first remove jitter and spikes from recordings, moving only spikes by more than 2mm or another length"
        " with its unit (any); errors are relative to the cleaned motion",
    )


def _clean_length(text: str) -> float:
    parts = re.fullmatch(r"(\d{1,6}\.?\d{0,6}|\.\d{1,6})\s*(mm|cm|m)", text.strip().lower())
    if not parts or not float(parts[1]):
        raise ValueError(f"{text!r} is not a length such as 2mm: write --clean after the inputs, or --clean=2mm")
    return float(parts[1]) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0}[parts[2]]


def reading_options(options: argparse.Namespace) -> ReadingOptions:
    """Return the parsed options of this group. Raises ValueError for contradictory ones."""
    if options.degrees and not options.euler:
        raise ValueError("--degrees is for Euler angles: add their order, such as --euler YXZ")
    return ReadingOptions(
        **{one.name: vars(options)[one.name] for one in fields(ReadingOptions) if one.name in options}
    )


def _columns(text: str) -> tuple[tuple[str, str], ...]:
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(separator and column.strip() for _, separator, column in pairs):
        raise ValueError(f"{text!r} names no columns; write t=timestamp_ms,x=pos_x,...")
    return ReadingOptions(columns=tuple((meaning.strip(), column.strip()) for meaning, _, column in pairs)).columns


def _field(name: str, convert: Callable[[str], Any]) -> Callable[[str], object]:
    """Return a function that parses one field of `ReadingOptions`, with its checks."""
    return lambda text: getattr(ReadingOptions(**{name: convert(text)}), name)
