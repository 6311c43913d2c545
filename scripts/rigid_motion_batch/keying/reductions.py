"""Reducing keys: how few, of what and how written, and how they are spoken of. No Blender is needed here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.rest_bodies import unit_of

FRAME_RATE_RANGE = 1, 240
"""Frames a second that a .blend file may be given for the rate of its recording."""

MIN_TOLERANCE_MM = 1e-6
"""Millimetres: no tolerance is smaller."""

TOLERANCE = Tolerance("5mm")
"""The tolerance where none is given, of tables and .blend files."""

SUFFIX, GLB_SUFFIX = "-keys", "-reduced"
"""Endings of the names of files that are written, and of GLB files."""

MIN_BODY_JOINTS = 8
"""So many joints or bones make a body, whose size says something of its unit; a prop has any size."""


@dataclass(frozen=True, kw_only=True)
class Reductions:
    """How few keys are to be kept, of what, and how they are written: plain data."""

    mode: str
    curves: bool
    """True for Blender's own curves in place of a mode."""

    fewest: bool
    """True where neither was asked for: whole bodies get what needs fewer keys."""

    tolerance: Tolerance | None
    """The tolerance; where None, what each thing begins with in Blender's window, or `reduce.py` with recordings."""

    radius: float | None
    """The radius of the shell in metres; what each object and bone measures,
    or what `compare` takes of recordings, where None."""

    shared: bool
    """True if all bones of a rig get keys on the same frames."""

    discard: bool
    """True if the dense keys go out of the file, so that Restore Keys cannot give them back."""

    count: int | None
    """So many keys of each object, or key poses of each rig, instead of a tolerance."""

    channels: str
    """Of glTF files: which channels keep a key though they leave a node as it rests."""

    feet: bool
    """Of glTF files: True if feet that stand keep to where they stand, however large the tolerance is."""

    meshopt: bool
    """Of glTF files: True if they are compressed by meshopt."""

    axes: str | None
    """Of recordings; None for those of each format."""

    reading: ReadingOptions

    blend: bool
    """True if rigid motions become .blend files too."""

    fps: int | None
    """Of files that are made of recordings; None for the rate of each."""

    glb: bool
    """True if GLB files are written, and nothing else."""

    report: bool
    """True if a page shows what glTF files were and are."""


def name_of(file: Path, body: str | None) -> str:
    """Return what the files of a body are called: as the recording, and where the body was named, as that too."""
    return "-".join([file.stem, *(folder_names([body]) if body else [])])


def as_length(metres: float) -> Tolerance:
    """Return a length as a user would write it."""
    number, unit = (metres, "m") if metres >= 1.0 else (1e3 * metres, "mm")
    return Tolerance(f"{max(number, MIN_TOLERANCE_MM):.6f}{unit}")


def as_text(metres: float) -> str:
    """Return a length as it is spoken of."""
    return as_length(metres).alike(metres, 1.0)


def doubt(size: float, joints: int, tolerance: Tolerance | None, per_unit: float) -> str:
    """Return what to think of where a tolerance is in metres, and a body of this size in metres hardly is;
    mostly nothing.
    """
    name, length = unit_of(size)
    if joints < MIN_BODY_JOINTS or tolerance is None or not tolerance.is_length or length == 1.0:
        return ""
    meant = tolerance.metres(per_unit) / (per_unit * length)
    return f"; it is {size:.3g} m large in this file: if these are {name}, give --tolerance {meant:.6g}"


def off(tolerance: Tolerance, metres: float, per_unit: float, *, by_number: bool) -> str:
    """Return how far off that is, in the unit of the tolerance, which is of so many metres where it says none."""
    if by_number:
        return f", {tolerance.alike(metres, per_unit)} off at most"
    allowed = tolerance.alike(tolerance.metres(per_unit), per_unit)
    return f", {tolerance.alike(metres, per_unit)} off at most ({allowed} allowed)"
