"""How few keys are wanted, and how they are spoken of. No Blender is needed here."""

from __future__ import annotations

from dataclasses import dataclass

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.recordings.rest_bodies import unit_of


@dataclass(frozen=True)
class Wishes:
    """How few keys are wanted, of what."""

    mode: str
    tolerance: Tolerance | None
    """The tolerance; where None, what each thing begins with in Blender's window, or `reduce.py` with recordings."""

    radius: float | None
    """The radius of the shell in metres; what each object and bone measures,
    or what `compare` takes of recordings, where None."""

    shared: bool
    """True if all bones of a rig get keys on the same frames."""

    discard: bool = False
    """True if the dense keys go out of the file, so that Restore Keys cannot give them back."""

    count: int | None = None
    """So many keys of each object, or key poses of each rig, instead of a tolerance."""

    vertices: bool = False
    """True if the vertices of skins are measured, in glTF files."""


def doubt(size: float, tolerance: Tolerance | None, per_unit: float) -> str:
    """Return what to think of where a tolerance is in metres, and a body of this size in metres hardly is;
    mostly nothing.
    """
    name, length = unit_of(size)
    if tolerance is None or not tolerance.is_length or length == 1.0:
        return ""
    meant = tolerance.metres(per_unit) / (per_unit * length)
    return f"; it is {size:.3g} m large in this file: if these are {name}, give --tolerance {meant:.6g}"


def fewer(before: int, after: int) -> str:
    """Return how many keys became how many."""
    return f", {before} -> {after} keys"


def off(tolerance: Tolerance, metres: float, per_unit: float, *, by_number: bool) -> str:
    """Return how far off that is, in the unit of the tolerance, which is of so many metres where it says none."""
    if by_number:
        return f", {tolerance.alike(metres, per_unit)} off at most"
    allowed = tolerance.alike(tolerance.metres(per_unit), per_unit)
    return f", {tolerance.alike(metres, per_unit)} off at most ({allowed} allowed)"
