"""Settings of a report: facts about a run that its page shows besides the numbers. Plain data, as task parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rigid_motion_batch.analysis.choices import JOINT_RADIUS_M
from rigid_motion_batch.analysis.modes import REFERENCE


@dataclass(frozen=True)
class PageSettings:
    """Facts about a run that a page shows, except the date."""

    radius: float
    """The radius of the shell of a rigid body, in metres."""

    program: str
    """Name and version."""

    command: str
    """The command line, as typed."""

    reference: str = REFERENCE
    """The mode that the others are compared with."""

    joint_radius: float = JOINT_RADIUS_M
    """The radius of the shell of a joint, in metres."""

    details: Mapping[str, str] = field(default_factory=dict)
    """Other facts worth a line, such as Blender's version: name to value."""
