"""Settings for reducing keys, and how errors and lengths are worded. No Blender is needed here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.rest_bodies import unit_of

FRAME_RATE_RANGE = 1, 240
"""The frame rates (frames per second) that a .blend file may take from its recording."""

MIN_TOLERANCE_MM = 1e-6
"""The smallest tolerance, in millimetres."""

TOLERANCE = Tolerance("5mm")
"""The default tolerance for tables and .blend files."""

SUFFIX, GLB_SUFFIX = "-keys", "-reduced"
"""Name endings of written files, and of written GLB files."""

MIN_BODY_JOINTS = 8
"""From this many joints or bones on, the size suggests the unit of a body; a prop can have any size."""


@dataclass(frozen=True, kw_only=True)
class Reductions:
    """Settings for reducing keys: how many keys to keep, and how to write them. Plain data."""

    mode: str
    curves: bool
    """True for Blender's own F-curves in place of a mode."""

    fewest: bool
    """True if neither a mode nor curves were requested: each whole body gets whichever needs fewer keys."""

    tolerance: Tolerance | None
    """The tolerance; None for the initial value in Blender's window, or for recordings the default of `reduce.py`."""

    radius: float | None
    """The radius of the shell in metres; None for the measured size of each object and bone, or for recordings the
    radius that `compare` uses.
    """

    shared: bool
    """True if all bones of a rig get keys on the same frames."""

    discard: bool
    """True if the dense keys are removed from the file, so that Restore Keys cannot bring them back."""

    count: int | None
    """The number of keys per object, or of key poses per rig, instead of a tolerance."""

    channels: str
    """For glTF files: which channels keep a key even if they leave a node at rest."""

    feet: bool
    """For glTF files: True if planted feet stay in place, however large the tolerance is."""

    meshopt: bool
    """For glTF files: True to compress them with meshopt."""

    axes: str | None
    """The axes of recordings; None for the default of each format."""

    reading: ReadingOptions

    blend: bool
    """True if rigid motions are also written as .blend files."""

    fps: int | None
    """The frame rate of .blend files made from recordings; None for the recorded rate."""

    glb: bool
    """True if only GLB files are written."""

    report: bool
    """True if a page compares glTF files before and after."""


def name_of(file: Path, body: str | None) -> str:
    """Return the base name for files of a body: the recording's, and the body's if it was named."""
    return "-".join([file.stem, *(folder_names([body]) if body else [])])


def as_length(metres: float) -> Tolerance:
    """Return a length as a user would write it."""
    number, unit = (metres, "m") if metres >= 1.0 else (1e3 * metres, "mm")
    return Tolerance(f"{max(number, MIN_TOLERANCE_MM):.6f}{unit}")


def as_text(metres: float) -> str:
    """Return a length as text for messages."""
    return as_length(metres).alike(metres, 1.0)


def doubt(size: float, joints: int, tolerance: Tolerance | None, per_unit: float) -> str:
    """Return a hint if a tolerance is in metres but a body of this size probably is not; usually an empty string."""
    name, length = unit_of(size)
    if joints < MIN_BODY_JOINTS or tolerance is None or not tolerance.is_length or length == 1.0:
        return ""
    meant = tolerance.metres(per_unit) / (per_unit * length)
    return f"; it is {size:.3g} m large in this file: if these are {name}, give --tolerance {meant:.6g}"


def off(tolerance: Tolerance, metres: float, per_unit: float, *, by_number: bool) -> str:
    """Return the error as text in the unit of the tolerance; a tolerance without a unit is in `per_unit` metres."""
    if by_number:
        return f", {tolerance.alike(metres, per_unit)} off at most"
    allowed = tolerance.alike(tolerance.metres(per_unit), per_unit)
    return f", {tolerance.alike(metres, per_unit)} off at most ({allowed} allowed)"
