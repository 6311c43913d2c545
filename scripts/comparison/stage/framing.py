"""Framing: from which side a motion is seen, and whether the camera stays or follows it.

The camera itself never moves: what moves past it is the lane, by the focus, a path in Blender's axes and metres. A
motion that has room where it is stays there; one that would be small is followed, smoothly, so that its quick turns
still show. NumPy alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from addon.motion import Poses
from addon.motion.quaternions import rotate

from . import layout

FOLLOW_GAIN = 1.2
"""A motion is followed where that shows it so many times larger."""

SMOOTHING = 0.12
"""Seconds of the film: the standard deviation of the bell by which the focus is smoothed."""


@dataclass(frozen=True, eq=False)
class Framing:
    """How a motion of n moments is seen."""

    focus: np.ndarray
    """What the camera looks at, shape (n, 3)."""

    yaw: float
    """The turn about z in radians that shows the motion from its broad side."""

    follows: bool

    def extent(self, shown: Sequence[Poses], outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest of right, up and away, shape (3,) each, that points of any poses (n,) reach.

        As `layout.project` has them, from the focus on.
        """
        turn = layout.yaw_quaternion(self.yaw)
        seen = [layout.project(rotate(turn, self._from_focus(poses, outline))) for poses in shown]
        return np.min([points.min(axis=0) for points in seen], axis=0), np.max([p.max(axis=0) for p in seen], axis=0)

    def _from_focus(self, poses: Poses, outline: np.ndarray) -> np.ndarray:
        return layout.swept_points(Poses(poses.positions - self.focus, poses.quaternions, poses.scales), outline)

    @classmethod
    def of(cls, recording: Poses, outline: np.ndarray, smoothing: float) -> Framing:
        """What shows a recording (n,) of an object with these outermost points (m, 3) well.

        `smoothing` is `SMOOTHING` in moments of the recording.
        """
        middle = (outline.min(axis=0) + outline.max(axis=0)) / 2.0
        path = _smoothed(layout.swept_points(recording, middle[None]), smoothing)
        still = cls._facing(recording, outline, np.zeros_like(path), follows=False)
        following = cls._facing(recording, outline, path, follows=True)
        gain = still._height(recording, outline) / following._height(recording, outline)
        return following if gain > FOLLOW_GAIN else still

    @classmethod
    def _facing(cls, recording: Poses, outline: np.ndarray, focus: np.ndarray, *, follows: bool) -> Framing:
        framing = cls(focus, 0.0, follows)
        return cls(focus, layout.heading(framing._from_focus(recording, outline)), follows)

    def _height(self, recording: Poses, outline: np.ndarray) -> float:
        """What a square picture has to span."""
        low, high = self.extent([recording], outline)
        return float((high - low)[:2].max())


def _smoothed(path: np.ndarray, deviation: float) -> np.ndarray:
    """A path (n, 3) smoothed by a bell whose standard deviation is so many samples. It begins and ends where it did."""
    reach = int(np.ceil(3.0 * deviation))
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(deviation, 1e-9)) ** 2)
    extended = np.pad(path, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([np.convolve(column, bell / bell.sum(), mode="valid") for column in extended.T], axis=-1)
