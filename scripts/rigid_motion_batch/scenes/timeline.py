"""The timeline of a film: the moments of a clip that its frames show, and the poses at these moments.

Frame 1 is the first key. Between two frames there are fine frames, at which paths are drawn, so that the corners of a
path at its keys show. Poses are in Blender's axes and metres, centred on the recording: Blender has single precision,
and a recording may be far from its origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.analysis.reconstructions import Reconstruction

PATH_RATE = 60.0
"""Minimum number of path points per second of the film."""


@dataclass(frozen=True)
class Timeline:
    """Converts between the clip's time in seconds and the film's frames."""

    start: float
    """The time of the first key, in the clip's time."""

    count: int
    """The number of frames."""

    rate: float
    """Frames per second of the clip."""

    steps: int
    """Fine frames per frame."""

    @classmethod
    def between(cls, start: float, end: float, fps: int, slow_motion: float) -> Timeline:
        """Return the timeline between two moments of a clip, `slow_motion` times slower than real time."""
        rate = fps * slow_motion
        count = math.floor((end - start) * rate + 1e-6) + 1
        return cls(start, count, rate, max(1, math.ceil(PATH_RATE / fps)))

    @property
    def frames(self) -> np.ndarray:
        """1, 2, ..., shape (count,)."""
        return np.arange(1.0, self.count + 1.0)

    @property
    def fine_frames(self) -> np.ndarray:
        """The frames and the steps between them, shape ((count - 1) steps + 1,)."""
        return 1.0 + np.arange((self.count - 1) * self.steps + 1) / self.steps

    def frames_per_key(self, keys: int) -> float:
        """Return the average number of frames between two of this number of keys."""
        return (self.count - 1) / max(1, keys - 1) or 1.0

    def times_of(self, frames: np.ndarray) -> np.ndarray:
        """Return the clip's times shown by frames."""
        return self.start + (frames - 1.0) / self.rate

    def frames_of(self, times: np.ndarray) -> np.ndarray:
        """Return the (fractional) frames that show the clip's times."""
        return 1.0 + (times - self.start) * self.rate


def peaks(values: np.ndarray, columns: int) -> np.ndarray:
    """Return the sorted indices of the minimum and maximum of values (n,) in each column, and of both ends."""
    parts = np.array_split(np.arange(len(values)), min(columns, len(values)))
    chosen = [part[find(values[part])] for part in parts for find in (np.argmin, np.argmax)]
    return np.unique([0, *chosen, len(values) - 1])


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """The motion on the stage: poses at the fine frames of a timeline."""

    recording: Poses

    modes: dict[str, Poses]
    """Mode id to poses."""

    keys: dict[str, Poses]
    """Mode id to the poses at its keys, shape (k,)."""

    key_frames: dict[str, np.ndarray]
    """Mode id to the frames of its keys, shape (k,)."""

    centre: np.ndarray
    """The centre of the recording, which became the origin: in Blender's axes, shape (3,)."""

    @classmethod
    def of(cls, reconstruction: Reconstruction, timeline: Timeline) -> ShownMotion:
        """Return the motion with each mode evaluated at the fine frames, not joined from its values at the samples."""
        clip, kept = reconstruction.clip, {mode: keys for mode, (keys,) in reconstruction.keys.items()}
        times = timeline.times_of(timeline.fine_frames)

        recording = clip.in_blender(interpolate(clip.times, clip.poses, times, "dq_sclerp"))
        centre = (recording.positions.min(axis=0) + recording.positions.max(axis=0)) / 2.0
        return cls(
            recording=_centred_on(centre, recording),
            modes={mode: _centred_on(centre, clip.in_blender(reconstruction.filled_in(mode, times))) for mode in kept},
            keys={mode: _centred_on(centre, clip.in_blender(clip.poses[own])) for mode, own in kept.items()},
            key_frames={mode: timeline.frames_of(clip.times[own]) for mode, own in kept.items()},
            centre=centre,
        )


def _centred_on(centre: np.ndarray, poses: Poses) -> Poses:
    return Poses(poses.positions - centre, poses.quaternions, poses.scales)
