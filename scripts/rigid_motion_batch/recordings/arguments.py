"""The options of a command line that say of recordings what their files do not."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from rigid_motion_batch.axes import AXES
from rigid_motion_batch.command_line import number

from .options import TICKS, ReadingOptions


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """Add a group of options: `--axes`, and others of which `reading_options` makes one thing."""
    group = parser.add_argument_group("reading", "For recordings that leave something out; docs/csv.md has examples.")
    group.add_argument(
        "--axes", type=str.lower, choices=AXES, help="axes of the recordings (opengl for BVH, blender for others)"
    )
    group.add_argument(
        "--columns",
        type=_columns,
        default=(),
        metavar="t=NAME,...",
        help="columns of CSVs by name: t, x, y, z, qx, qy, qz, qw, rx, ry, rz (Euler angles), scale, device",
    )
    group.add_argument("--time-unit", choices=TICKS, help="unit of the times, whatever the file says")
    group.add_argument(
        "--frame-rate",
        type=_field("frame_rate", number),
        metavar="HZ",
        help="frames a second, where a column counts frames, not seconds",
    )
    group.add_argument(
        "--scale", type=_field("scale", number), metavar="M", help="metres in a unit of length: 0.01 for centimetres"
    )
    group.add_argument(
        "--euler",
        type=_field("euler", str),
        metavar="ORDER",
        help="order of the Euler angles of CSVs: YXZ about the moved axes (intrinsic), zxy about those of the world",
    )
    group.add_argument(
        "--degrees", action="store_true", help="the Euler angles are in degrees (as the columns' names say, or radians)"
    )
    group.add_argument(
        "--start",
        type=_field("start", number),
        metavar="S",
        help="begin so many seconds after the first sample; 0 keeps a T-pose that would be left out",
    )
    group.add_argument(
        "--end", type=_field("end", number), metavar="S", help="end so many seconds after the first sample"
    )


def reading_options(options: argparse.Namespace) -> ReadingOptions:
    """Return what the options of that group say. Raises ValueError for some that do not go together."""
    if options.degrees and not options.euler:
        raise ValueError("--degrees is for Euler angles: add their order, such as --euler YXZ")
    return ReadingOptions(**{field.name: getattr(options, field.name) for field in fields(ReadingOptions)})


def _columns(text: str) -> tuple[tuple[str, str], ...]:
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(separator and column.strip() for _, separator, column in pairs):
        raise ValueError(f"{text!r} names no columns; write t=timestamp_ms,x=pos_x,...")
    return ReadingOptions(columns=tuple((meaning.strip(), column.strip()) for meaning, _, column in pairs)).columns


def _field(name: str, convert: Callable[[str], Any]) -> Callable[[str], object]:
    """Return a function that reads one field of `ReadingOptions`, which checks it."""
    return lambda text: getattr(ReadingOptions(**{name: convert(text)}), name)
