"""Framing: the side from which a motion is seen, and whether the view stays or follows the motion.

The camera itself never moves; the lane moves past it, by the focus, a path in Blender's axes and metres. A motion that
is large enough in a fixed view gets one; a motion that would be small is followed, smoothly, so that its quick turns
still show. Uses only NumPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate

from . import layout

FOLLOW_GAIN = 1.2
"""A motion is followed if that shows it larger by this factor."""

MAX_LEVEL_RATIO = 0.3
"""A body is followed over the ground only if its centre rises and falls by less than this fraction of its height."""

MIN_WALKED_RATIO = 0.5
"""A body that travels at least this far, in units of its height, is seen from the side."""

THREE_QUARTER = np.radians(30.0)
"""The angle by which a walk comes nearer to the camera, in radians."""

MAX_SMOOTHING_S = 0.12
"""Maximum standard deviation of the Gaussian that smooths the focus, in seconds of the film."""

MAX_BESIDE_RATIO = 0.5
"""Deviating motions may leave the recording's extent by this fraction of it; anything farther is cut off."""

MAX_LAG_RATIO = 1.35
"""Maximum ratio of the extent with a smoothed focus to that with an unsmoothed one."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid object."""

    poses: Poses
    """Shape (n,)."""

    outline: np.ndarray
    """Its outermost points, shape (m, 3)."""

    @property
    def middle(self) -> np.ndarray:
        """The points that may be followed, shape (n, 3)."""
        middle = (self.outline.min(axis=0) + self.outline.max(axis=0)) / 2.0
        return layout.swept_points(self.poses, middle[None])

    def around(self, focus: np.ndarray) -> np.ndarray:
        """Return its outermost points at all moments, relative to the focus (n, 3): shape (k, 3)."""
        poses = Poses(self.poses.positions - focus, self.poses.quaternions, self.poses.scales)
        return layout.swept_points(poses, self.outline)

    def heading(self, focus: np.ndarray) -> float:
        """Return the yaw in radians that shows its broad side."""
        return layout.heading(self.around(focus))


@dataclass(frozen=True, eq=False)
class Jointed:
    """A body of joints."""

    places: np.ndarray
    """Shape (n, m, 3)."""

    surface: np.ndarray
    """Other visible points of the body, shape (n, k, 3)."""

    @property
    def middle(self) -> np.ndarray:
        """The mean of the joints, at constant height if the body roughly stays level: steps should not make it nod."""
        middle = self.places.mean(axis=1)
        tall = float(np.ptp(self.places[..., 2], axis=1).max())
        if np.ptp(middle[:, 2]) < MAX_LEVEL_RATIO * tall:
            middle[:, 2] = np.median(middle[:, 2])
        return middle

    def around(self, focus: np.ndarray) -> np.ndarray:
        return (np.concatenate((self.places, self.surface), axis=1) - focus[:, None]).reshape(-1, 3)

    def heading(self, focus: np.ndarray) -> float:
        """Return the yaw in radians that shows a walk going right and a little towards the camera; without a walk, the
        broad side.
        """
        middle = self.middle
        gone = middle[-1, :2] - middle[0, :2]
        tall = float(np.ptp(self.places[..., 2], axis=1).max())
        if np.linalg.norm(gone) < MIN_WALKED_RATIO * tall:
            return layout.heading(self.around(focus))
        return float(-np.arctan2(gone[1], gone[0]) - THREE_QUARTER)


Moving = Solid | Jointed
"""A subject at n moments."""


@dataclass(frozen=True, eq=False)
class Extent:
    """The visible bounds of the motion, relative to the focus: lowest and highest right, up and away, shape (3,) each.

    In the coordinates of `layout.project`.
    """

    low: np.ndarray
    high: np.ndarray

    cut: bool
    """True if something moves beyond these bounds to the sides."""

    @property
    def size(self) -> np.ndarray:
        """Width and height in metres."""
        return (self.high - self.low)[:2]

    @property
    def depth(self) -> float:
        return float(self.high[2] - self.low[2])


@dataclass(frozen=True, eq=False)
class Framing:
    """The view of a motion of n moments."""

    focus: np.ndarray
    """The points that the camera looks at, shape (n, 3)."""

    yaw: float
    """The rotation about z, in radians, that shows the motion well."""

    follows: bool

    def extent(self, recording: Moving, shown: Sequence[Moving] = ()) -> Extent:
        """Return the bounds of a recording, extended for other motions as long as that does not make it small."""
        turn = layout.yaw_quaternion(self.yaw)
        seen = [layout.project(rotate(turn, moving.around(self.focus))) for moving in (recording, *shown)]
        lows, highs = (np.array([edge(points, axis=0) for points in seen]) for edge in (np.min, np.max))
        low, high = lows.min(axis=0), highs.max(axis=0)
        beside = MAX_BESIDE_RATIO * float((highs[0] - lows[0])[:2].max())
        least, most = np.append((lows[0] - beside)[:2], -np.inf), np.append((highs[0] + beside)[:2], np.inf)
        return Extent(np.maximum(low, least), np.minimum(high, most), bool((low < least).any() or (high > most).any()))

    @classmethod
    def of(cls, recording: Moving, smoothing: float) -> Framing:
        """Return the framing that shows a recording well.

        `smoothing` is `MAX_SMOOTHING_S` in moments of the recording; less is used if that shows more.
        """
        still = cls._facing(recording, np.zeros_like(recording.middle), follows=False)
        closest = cls(recording.middle, still.yaw, follows=True)._width(recording)
        if still._width(recording) <= FOLLOW_GAIN * closest:
            return still
        for share in (1.0, 0.5, 0.25):
            following = cls._facing(recording, _smoothed(recording.middle, share * smoothing), follows=True)
            if following._width(recording) <= MAX_LAG_RATIO * closest:
                break
        return following

    @classmethod
    def _facing(cls, recording: Moving, focus: np.ndarray, *, follows: bool) -> Framing:
        return cls(focus, recording.heading(focus), follows)

    def _width(self, recording: Moving) -> float:
        """Return the side of a square with the area of the visible bounds."""
        return float(np.sqrt(self.extent(recording).size.prod()))


def _smoothed(path: np.ndarray, deviation: float) -> np.ndarray:
    """Return a path (n, 3) smoothed by a Gaussian with this standard deviation, in samples; its ends stay in place."""
    reach = int(np.ceil(3.0 * deviation))
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(deviation, 1e-9)) ** 2)
    extended = np.pad(path, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([np.convolve(column, bell / bell.sum(), mode="valid") for column in extended.T], axis=-1)
