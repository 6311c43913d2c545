"""What a comparison is about: a recorded clip, and what each mode makes of the few keys that are kept of it.

Times are seconds and poses are in the recording's own axes and units, repaired. Errors are in metres and do not depend
on the axes; only what Blender shows is converted (`scripts.trajectories.axes`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from addon.motion import Poses
from addon.motion.measures import Errors


@dataclass(frozen=True, eq=False)
class Clip:
    """One body of one recording, of n samples."""

    name: str
    """Unique among the clips of a run, and safe as the name of a folder."""

    source: str
    """What the user gave: the file, and the body where one was named."""

    axes: str
    """The convention of the recording: a name in `scripts.trajectories.axes.AXES`."""

    times: np.ndarray
    """Seconds, strictly rising, shape (n,)."""

    poses: Poses
    """Shape (n,), signs aligned."""

    repairs: tuple[str, ...]
    """What had to be repaired in the recording, a sentence each."""

    metres_per_unit: float = 1.0
    """The length of the recording's unit. Errors, and what Blender shows, are in metres."""

    def in_metres(self, poses: Poses) -> Poses:
        """Poses of this clip with positions in metres."""
        if self.metres_per_unit == 1.0:
            return poses
        return Poses(poses.positions * self.metres_per_unit, poses.quaternions, poses.scales)


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A clip at one rate: the keys that were kept, and what each mode filled in between them."""

    clip: Clip

    rate: str
    """Keys a second, as the user wrote it."""

    keys: np.ndarray
    """The samples that were kept, rising indices into the clip, shape (k,)."""

    poses: dict[str, Poses]
    """Mode id to the poses at `times`."""

    errors: dict[str, Errors]
    """Mode id to the errors against the clip at `times`."""

    @property
    def samples(self) -> slice:
        """The samples of the clip between its first and its last key, both included."""
        return slice(int(self.keys[0]), int(self.keys[-1]) + 1)

    @property
    def times(self) -> np.ndarray:
        """The times of `samples`."""
        return self.clip.times[self.samples]
