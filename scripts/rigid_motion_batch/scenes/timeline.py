"""The timeline: which moments of a clip the frames show, and the poses at those moments as Blender takes them.

Frame 1 is the first key. Between two frames there are fine frames, at which paths are drawn, so that the corners of a
path at its keys show. Poses are in Blender's axes and metres, around the middle of the recording: Blender has single
precision, and a recording may be far from its origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.analysis.reconstructions import Reconstruction

PATH_RATE = 60.0
"""At least so many points of a path are drawn for a second of the film."""


@dataclass(frozen=True)
class Timeline:
    """The clip's time, in seconds, and the film's, in frames."""

    start: float
    """The moment of the first key, in the clip's time."""

    count: int
    """The number of frames."""

    rate: float
    """Frames for a second of the clip."""

    steps: int
    """Fine frames for a frame."""

    @classmethod
    def between(cls, start: float, end: float, fps: int, slow_motion: float) -> Timeline:
        """Return all frames between two moments of a clip, `slow_motion` times slower than life."""
        rate = fps * slow_motion
        count = math.floor((end - start) * rate + 1e-6) + 1
        return cls(start, count, rate, max(1, math.ceil(PATH_RATE / fps)))

    @property
    def frames(self) -> np.ndarray:
        """1, 2, ..., shape (count,)."""
        return np.arange(1.0, self.count + 1.0)

    @property
    def fine_frames(self) -> np.ndarray:
        """The frames and the moments between them, shape ((count - 1) steps + 1,)."""
        return 1.0 + np.arange((self.count - 1) * self.steps + 1) / self.steps

    def frames_per_key(self, keys: int) -> float:
        """Return how many frames lie between two of so many keys, on average."""
        return (self.count - 1) / max(1, keys - 1) or 1.0

    def times_of(self, frames: np.ndarray) -> np.ndarray:
        """Return the clip's times that frames show."""
        return self.start + (frames - 1.0) / self.rate

    def frames_of(self, times: np.ndarray) -> np.ndarray:
        """Return the frames, not whole ones, that show the clip's times."""
        return 1.0 + (times - self.start) * self.rate


def peaks(values: np.ndarray, columns: int) -> np.ndarray:
    """Return the numbers, rising, of the least and the largest of values (n,) in each of so many columns;
    the ends too.
    """
    parts = np.array_split(np.arange(len(values)), min(columns, len(values)))
    chosen = [part[find(values[part])] for part in parts for find in (np.argmin, np.argmax)]
    return np.unique([0, *chosen, len(values) - 1])


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """What moves on the stage: poses at the fine frames of a timeline."""

    recording: Poses

    modes: dict[str, Poses]
    """Mode id to poses."""

    keys: dict[str, Poses]
    """Mode id to the poses that were kept, shape (k,)."""

    key_frames: dict[str, np.ndarray]
    """Mode id to when they are, shape (k,)."""

    centre: np.ndarray
    """The middle of the recording, which became the origin: in Blender's axes, shape (3,)."""

    @classmethod
    def of(cls, reconstruction: Reconstruction, timeline: Timeline) -> ShownMotion:
        """Return every mode's own in-betweens, not those of the recording's sample times joined by lines."""
        clip, kept = reconstruction.clip, {mode: keys for mode, (keys,) in reconstruction.keys.items()}
        times = timeline.times_of(timeline.fine_frames)

        recording = clip.in_blender(interpolate(clip.times, clip.poses, times, "dq_sclerp"))
        centre = (recording.positions.min(axis=0) + recording.positions.max(axis=0)) / 2.0
        return cls(
            recording=_around(centre, recording),
            modes={mode: _around(centre, clip.in_blender(reconstruction.filled_in(mode, times))) for mode in kept},
            keys={mode: _around(centre, clip.in_blender(clip.poses[own])) for mode, own in kept.items()},
            key_frames={mode: timeline.frames_of(clip.times[own]) for mode, own in kept.items()},
            centre=centre,
        )


def _around(centre: np.ndarray, poses: Poses) -> Poses:
    return Poses(poses.positions - centre, poses.quaternions, poses.scales)
