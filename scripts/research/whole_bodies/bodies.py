"""Whole bodies in motion, and what is left of it between few keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigid_motion.motion import Poses, Skeleton, interpolate, shell_error

RADIUS = 0.03
"""Of the ball at every joint, in metres."""

Keys = Sequence[np.ndarray]
"""The samples that are keys, for each joint."""


@dataclass(frozen=True, eq=False)
class Body:
    """A body with a pose on every frame."""

    name: str
    rate: float
    """Frames a second."""

    joints: tuple[str, ...]
    parents: np.ndarray
    """Shape (joints,), -1 for roots."""

    poses: Poses
    """Shape (joints, n), each in its parent's space; z is up in that of roots. In metres."""

    moving: np.ndarray
    """How many channels of each joint's location ever change, shape (joints,)."""

    turning: np.ndarray
    """How many of its rotation."""

    enlarged: float = 1.0
    """How many times larger than in the file."""

    @property
    def frames(self) -> int:
        return self.poses.shape[1]

    @property
    def times(self) -> np.ndarray:
        return np.arange(self.frames) / self.rate

    @cached_property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.parents)

    @cached_property
    def truth(self) -> Poses:
        """Where the joints are, shape (joints, n)."""
        return self.skeleton.in_root_space(self.poses)

    @property
    def extent(self) -> float:
        """The largest extent of the joints in the first frame, along any of the three axes."""
        return float(np.ptp(self.truth.positions[:, 0], axis=0).max())

    def of_size(self, extent: float) -> Body:
        """The same body, larger or smaller."""
        factor = extent / self.extent
        poses = Poses(factor * self.poses.positions, self.poses.quaternions)
        return replace(self, poses=poses, enlarged=factor * self.enlarged)

    def shown(self, keys: Keys, mode: str) -> Poses:
        """Where the joints are by their keys, shape (joints, n)."""
        shown = self.poses.copy()
        for joint, own in enumerate(keys):
            shown[joint] = interpolate(self.times[own], self.poses[joint][own], self.times, mode)
        return self.skeleton.in_root_space(shown)

    def shown_by_key_poses(self, keys: np.ndarray, mode: str) -> Poses:
        """The same where all joints have keys at the same samples."""
        return self.skeleton.in_root_space(interpolate(self.times[keys], self.poses[:, keys], self.times, mode))

    def errors(self, shown: Poses, radius: float = RADIUS) -> np.ndarray:
        """The largest displacement of any point in the balls, shape (joints, n)."""
        return shell_error(shown, self.truth, radius)


def repeated(body: Body, frames: int) -> Body:
    """A cycle's motion over and over, for so many frames, going on from where it got."""
    cycle = body.frames - 1
    rounds, sample = np.divmod(np.arange(frames), cycle)
    poses = body.poses[:, sample]
    roots = body.parents < 0
    positions = poses.positions.copy()
    way = body.poses.positions[roots, -1] - body.poses.positions[roots, 0]
    positions[roots] += rounds[:, None] * way[:, None]
    return replace(body, poses=Poses(positions, poses.quaternions))
