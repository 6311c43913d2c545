"""Knot paths: the motion shown at any moment, given the messages received so far.

All joints share the moments of their knots. Between two knots positions move straight and rotations turn about one
axis. Beyond the last knot the motion continues and comes to rest. Rotation vectors are radians in the joint's own axes.
Seconds.

When a holder takes a body or lets go of it, two knots share one moment: the last in the old space, and the first in the
new one, so nothing is interpolated between numbers of two spaces.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import turned, turns_between

CARRY_S = 0.15
"""Time constant in seconds: beyond the last knot a velocity v moves by v * CARRY_S * (1 - exp(-t / CARRY_S))."""

Side = Literal["left", "right"]


def carried(after: np.ndarray | float) -> np.ndarray:
    """Return for how many seconds of its velocity a motion continues, `after` seconds after its last knot."""
    return np.asarray(CARRY_S * -np.expm1(-np.maximum(after, 0.0) / CARRY_S))


@dataclass(frozen=True, eq=False)
class KnotPath:
    """Knots of all joints: rising moments (knots,), poses (joints, knots), and the motion at the last knot as
    velocities and angular velocities (joints, 3) per second.

    `holders` is the joint that holds each joint at each knot, shape (joints, knots); the pose is in its space. It is -1
    for joints in their own parent's space.
    """

    moments: np.ndarray
    poses: Poses
    velocities: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    spins: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    holders: np.ndarray = field(default_factory=lambda: np.full((1, 1), -1, dtype=np.int16))

    def __post_init__(self) -> None:
        holders = np.broadcast_to(self.holders, (len(self.holders), len(self.moments)))
        object.__setattr__(self, "holders", holders)

    def _knots_before(self, moments: np.ndarray, side: Side) -> np.ndarray:
        """Return the last knots at or before moments (n,); with side "left", strictly before them."""
        return np.clip(np.searchsorted(self.moments, moments, side=side) - 1, 0, len(self.moments) - 1)

    def at(self, moments: np.ndarray, side: Side = "right") -> Poses:
        """Return the poses at moments (n,), shape (joints, n). Before the first knot they are those of the first knot.

        When a body changes hands at a moment, they are the poses after the change or, with side "left", before it.
        """
        last, before = len(self.moments) - 1, self._knots_before(moments, side)
        after = np.minimum(before + 1, last)
        span = self.moments[after] - self.moments[before]
        span[span <= 0.0] = 1.0
        share = np.clip((moments - self.moments[before]) / span, 0.0, 1.0)[:, None]
        beyond = carried(moments - self.moments[last])[:, None]
        first, second = self.poses[:, before], self.poses[:, after]
        slides = share * (second.positions - first.positions) + beyond * self.velocities[:, None]
        vectors = share * turns_between(first.quaternions, second.quaternions) + beyond * self.spins[:, None]
        return Poses(first.positions + slides, turned(first.quaternions, vectors))

    def pose(self, moment: float) -> Poses:
        """Return the poses at a moment, shape (joints,)."""
        return self.at(np.array([moment]))[:, 0]

    def held_at(self, moment: float) -> np.ndarray:
        """Return the joint that holds each joint at a moment, shape (joints,); a single -1 if nothing is ever held."""
        return self.holders[:, self._knots_before(np.array([moment]), "right")[0]]

    def followed(self, other: KnotPath, lost: int = 0) -> KnotPath:
        """Return this path until the start of another, continued straight to the knots of the other.

        If `lost` windows between them are missing, the motion continued until the first of these windows; what happened
        then is unknown, so the path goes straight from there.

        Joints with another holder from the start of the other path on have the other path's pose there, and this path's
        before.
        """
        start, holders = other.moments[0], other.holders[:, :1]
        elsewhere = np.flatnonzero((self.holders != holders).any(axis=0))
        if lost and not (len(elsewhere) and elsewhere[-1] == len(self.moments) - 1):
            earliest = min(start, self.moments[elsewhere[-1]] if len(elsewhere) else -np.inf)
            start = max(start - lost * (other.moments[-1] - start), min(start, self.moments[-1]), earliest)
        kept, begin = int(np.searchsorted(self.moments, start)), np.array([start])
        moments, first = [self.moments[:kept], begin, other.moments[1:]], self.at(begin)
        poses, held = [self.poses[:, :kept], first, other.poses[:, 1:]], [self.holders[:, :kept], other.holders]
        if len(elsewhere):
            differs = self.held_at(start)[:, None] != holders
            first[differs] = other.poses[:, :1][differs]
            # It has the old holder up to the last knot before, or beyond all knots.
            until = self.holders[:, self._knots_before(begin, "left")]
            if (until != holders).any():
                moments.insert(1, begin)
                poses.insert(1, self.at(begin, "left"))
                held.insert(1, until)
        return KnotPath(
            np.concatenate(moments), joined(poses, axis=1), other.velocities, other.spins, np.concatenate(held, axis=1)
        )

    def extended(self, moment: float, poses: Poses) -> KnotPath:
        """Return this path with another knot at the end, of poses (joints,), for paths without holders."""
        return KnotPath(np.append(self.moments, moment), joined((self.poses, poses[:, None]), axis=1))

    def going_on(self) -> KnotPath:
        """Return the same path, with the velocity of its last segment continuing beyond the last knot."""
        if len(self.moments) < 2:
            return self
        before, last, span = self.poses[:, -2], self.poses[:, -1], self.moments[-1] - self.moments[-2]
        spins = turns_between(before.quaternions, last.quaternions) / span
        return KnotPath(self.moments, self.poses, (last.positions - before.positions) / span, spins, self.holders)

    def since(self, moment: float) -> KnotPath:
        """Return the same path without the knots that only affect earlier moments."""
        kept = max(int(np.searchsorted(self.moments, moment, side="right")) - 1, 0)
        return KnotPath(self.moments[kept:], self.poses[:, kept:], self.velocities, self.spins, self.holders[:, kept:])
