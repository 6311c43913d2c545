"""Recordings that are to be keyed: how they are read and written. No Blender is needed here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.clip_reading import folder_names

RATES = 1, 240
"""Frames a second that a .blend file may be given for the rate of its recording."""

TOLERANCE = Tolerance("5mm")
"""The tolerance where none is given, of tables and .blend files."""

SUFFIX, GLB_SUFFIX = "-keys", "-reduced"
"""Endings of the names of files that are written, and of GLB files."""


@dataclass(frozen=True)
class Reading:
    """How recordings are to be read."""

    axes: str | None
    """None for those of each format."""

    options: ReadingOptions


@dataclass(frozen=True)
class Writing:
    """What is to be written of recordings."""

    blend: bool
    """True if rigid motions become .blend files too."""

    fps: int | None
    """None for the rate of each recording."""

    glb: bool = False
    """True if GLB files are written, and nothing else."""


def name_of(file: Path, body: str | None) -> str:
    """Return what the files of a body are called: as the recording, and where the body was named, as that too."""
    return "-".join([file.stem, *(folder_names([body]) if body else [])])
