"""Clips: the repaired motion of one rigid body or of a whole figure of joints, the subject of a comparison.

Times are seconds. Poses are in the axes and units of the recording. Errors are in metres and do not depend on the axes;
poses are converted only for display in Blender (`rigid_motion_batch.axes`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.rest_bodies import RestBody


@dataclass(frozen=True)
class ClipWarning:
    """Warning of something that changes the meaning of the numbers, and what to do about it. `str` makes a sentence."""

    text: str
    way_out: str = ""
    start_s: float | None = None
    """Start of the affected part, in seconds of the recording's times; None if the whole recording is affected."""

    end_s: float | None = None

    def __str__(self) -> str:
        return f"{self.text}; {self.way_out}" if self.way_out else self.text


@dataclass(frozen=True, eq=False)
class OtherMotion:
    """Another motion of a clip, with its own samples, interpolated by straight lines and SLERP."""

    name: str
    """The name of the motion, also its id among the modes."""

    times: np.ndarray
    """Seconds of the clip's clock, strictly increasing, shape (m,)."""

    poses: Poses
    """Poses like those of the clip, shape (m,) or (joints, m)."""

    def at(self, times: np.ndarray) -> Poses:
        """Return the poses at any times (n,), shape (n,) or (joints, n)."""
        return interpolate(self.times, self.poses, times, "lerp_slerp")


@dataclass(frozen=True, eq=False)
class Clip:
    """One body of one recording, of n samples."""

    name: str
    """A name, unique among the clips of a run, and safe as a folder name."""

    source: str
    """The source that the user gave: the file, and the body if one was named."""

    axes: str
    """The convention of the recording: a name in `rigid_motion_batch.axes.DESCRIBED`."""

    times: np.ndarray
    """Seconds, strictly increasing, shape (n,)."""

    poses: Poses
    """Poses of shape (n,), signs aligned. For a figure shape (joints, n), each joint in its parent's space."""

    repairs: tuple[str, ...]
    """Sentences on implausible parts of the recording, and on the repairs made."""

    metres_per_unit: float = 1.0
    """The length of the recording's unit. Errors and the display in Blender are in metres."""

    body: str = ""
    """The body that the user asked for by name. It is added to the clip's name if another clip has the same name."""

    rest_body: RestBody | None = None
    """The rest body of a whole body; None for a single rigid body."""

    rate: float | None = None
    """Samples a second of the recording, if `times` may have additional samples in between."""

    warnings: tuple[ClipWarning, ...] = ()
    """Warnings of problems that change the meaning of the numbers, each with a way out."""

    calibration: int = 0
    """Number of samples of a T-pose or similar before the motion, which are left out."""

    against: OtherMotion | None = None
    """The motion that the user compares with the clip, in addition to the modes."""

    @property
    def samples_a_second(self) -> float:
        """The rate that the recording states, or else the rate of the median interval."""
        return self.rate or 1.0 / float(np.median(np.diff(self.times)))

    @property
    def joints(self) -> int:
        """The number of joints of a figure; 1 for a rigid body."""
        return len(self.rest_body.joints) if self.rest_body else 1

    @property
    def whole_body(self) -> RestBody:
        """The rest body of a clip that has one."""
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
    """Facts of a clip, without its samples."""

    name: str
    source: str
    axes: str
    samples: int
    duration: float
    """Seconds."""

    repairs: tuple[str, ...]

    joint_names: tuple[str, ...] = ()
    """The names of the joints of a whole body; empty for a single rigid body."""

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
