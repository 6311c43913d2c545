"""Recordings that are to be keyed: how they are read and written. No Blender is needed here."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError
from rigid_motion_batch.recordings.reading import split_source

from .options import place_of

RATES = 1, 240
"""Frames a second that a .blend file may be given for the rate of its recording."""

TOLERANCE = Tolerance("5mm")
"""Where none is given."""


@dataclass(frozen=True)
class Recorded:
    """A recording to be done."""

    source: str
    """The file, and the body where one was named."""

    @property
    def title(self) -> str:
        return os.path.basename(self.source)


@dataclass(frozen=True)
class Reading:
    """How recordings are to be read."""

    axes: str | None
    """None for those of each format."""

    options: ReadingOptions


@dataclass(frozen=True)
class Writing:
    """What is to be written of recordings, and where."""

    folder: Path | None
    """None for beside each recording."""

    overwrite: bool
    dry_run: bool
    blend: bool
    """Whether rigid motions become .blend files too."""

    fps: int | None
    """None for the rate of each recording."""

    glb: bool = False
    """Whether GLB files are written, and nothing else."""


def place_and_body(source: str) -> tuple[str, str | None]:
    """Where the file of a recording is, the same however it is written, and which body of it is meant."""
    try:
        file, body = split_source(source)
    except TrajectoryError:
        file, body = Path(source), None
    return place_of(file), body
