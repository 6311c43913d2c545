"""Clips: what a comparison is about, the motion of one rigid body, or of a whole figure of joints, in one recording.

Times are seconds and poses are in the recording's own axes and units, repaired. Errors are in metres and do not depend
on the axes; only what Blender shows is converted (`rigid_motion_batch.axes`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.rest_bodies import RestBody


@dataclass(frozen=True)
class ClipWarning:
    """Warning of what changes the meaning of the numbers, and what to do about it. As a string it is a sentence."""

    text: str
    way_out: str = ""
    start_s: float | None = None
    """The place in the recording, in seconds of its times; None where it is everywhere."""

    end_s: float | None = None

    def __str__(self) -> str:
        return f"{self.text}; {self.way_out}" if self.way_out else self.text


@dataclass(frozen=True, eq=False)
class OtherMotion:
    """Another motion of a clip, by its own samples; between these straight lines and SLERP."""

    name: str
    """The name of the motion, and its id beside those of modes."""

    times: np.ndarray
    """Seconds of the clip's clock, strictly rising, shape (m,)."""

    poses: Poses
    """Poses like those of the clip, shape (m,) or (joints, m)."""

    def at(self, times: np.ndarray) -> Poses:
        """Return the poses at any times (n,), shape (n,) or (joints, n)."""
        return interpolate(self.times, self.poses, times, "lerp_slerp")


@dataclass(frozen=True, eq=False)
class Clip:
    """One body of one recording, of n samples."""

    name: str
    """A name that is unique among the clips of a run, and safe as the name of a folder."""

    source: str
    """The source that the user gave: the file, and the body where one was named."""

    axes: str
    """The convention of the recording: a name in `rigid_motion_batch.axes.DESCRIBED`."""

    times: np.ndarray
    """Seconds, strictly rising, shape (n,)."""

    poses: Poses
    """Poses of shape (n,), signs aligned. Of a figure shape (joints, n), each joint's in its parent's space."""

    repairs: tuple[str, ...]
    """Sentences on what is hard to believe of the recording, and on what had to be repaired in it."""

    metres_per_unit: float = 1.0
    """The length of the recording's unit. Errors, and what Blender shows, are in metres."""

    body: str = ""
    """The body that the user asked for by name. It becomes part of the clip's where another clip has the same."""

    rest_body: RestBody | None = None
    """The rest body of a whole body; None for a single rigid body."""

    rate: float | None = None
    """Samples a second, where there may be more between these."""

    warnings: tuple[ClipWarning, ...] = ()
    """Warnings on the repairs that change the meaning of the numbers, with the way out."""

    calibration: int = 0
    """Samples of a T-pose or the like before the motion, which are left out."""

    against: OtherMotion | None = None
    """The motion that the user compares with it beside the modes."""

    @property
    def samples_a_second(self) -> float:
        """The rate of the recording, which tells it or has it between most samples."""
        return self.rate or 1.0 / float(np.median(np.diff(self.times)))

    @property
    def joints(self) -> int:
        """The number of joints of a figure, or the single one of a rigid body."""
        return len(self.rest_body.joints) if self.rest_body else 1

    @property
    def whole_body(self) -> RestBody:
        """The figure of a clip that has one."""
        assert self.rest_body is not None
        return self.rest_body

    def in_metres(self, poses: Poses) -> Poses:
        """Return poses of this clip with positions in metres."""
        if self.metres_per_unit == 1.0:
            return poses
        return Poses(poses.positions * self.metres_per_unit, poses.quaternions, poses.scales)

    def in_blender(self, poses: Poses) -> Poses:
        """Return poses of this clip in metres and Blender's axes."""
        return to_blender(self.in_metres(poses), self.axes)


@dataclass(frozen=True)
class ClipFacts:
    """A clip without its samples."""

    name: str
    source: str
    axes: str
    samples: int
    duration: float
    """Seconds."""

    repairs: tuple[str, ...]

    joint_names: tuple[str, ...] = ()
    """The names of the joints of a whole body; none of a single rigid one."""

    warnings: tuple[ClipWarning, ...] = ()
    body: str = ""
    """The body as the user named it."""

    against: str = ""
    """The name of the motion that the modes are compared with, if any."""

    @property
    def joints(self) -> int:
        return len(self.joint_names)

    @classmethod
    def of(cls, clip: Clip) -> ClipFacts:
        return cls(
            clip.name,
            clip.source,
            clip.axes,
            len(clip.times),
            float(clip.times[-1] - clip.times[0]),
            clip.repairs,
            clip.rest_body.joints if clip.rest_body else (),
            clip.warnings,
            clip.body,
            clip.against.name if clip.against else "",
        )
