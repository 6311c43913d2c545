"""What the reader of a report needs to know of a run, beyond the numbers. Plain data, as parameters of tasks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rigid_motion_batch.analysis.choices import JOINT_RADIUS_M
from rigid_motion_batch.analysis.modes import REFERENCE


@dataclass(frozen=True)
class PageSettings:
    """What a page says of a run, but for its date."""

    radius: float
    """Of the shell of a rigid body, in metres."""

    program: str
    """Name and version."""

    command: str
    """The command line, as one would type it."""

    reference: str = REFERENCE
    """The mode that the others are held against."""

    joint_radius: float = JOINT_RADIUS_M
    """Of the shell of a joint, in metres."""

    details: Mapping[str, str] = field(default_factory=dict)
    """Whatever else is worth a line, such as Blender's version: what it is, and its value."""
