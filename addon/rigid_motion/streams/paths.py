"""Paths: what is shown of some messages, at any moment.

All joints share the moments of their knots. Between two knots places go straight and turns go about one axis; beyond
the last knot the motion goes on as it was going, and comes to rest. Rotation vectors are radians in the joint's own
axes. Seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import turned, turns_between

CARRY = 0.15
"""Seconds: a motion of velocity v goes on by v * CARRY * (1 - exp(-t / CARRY)) beyond the last knot."""


def carried(after: np.ndarray | float) -> np.ndarray:
    """By how many seconds of its velocity a motion goes on, so many seconds after its last knot."""
    return np.asarray(CARRY * -np.expm1(-np.maximum(after, 0.0) / CARRY))


@dataclass(frozen=True, eq=False)
class Path:
    """Knots of all joints: rising moments (knots,), poses (joints, knots), and how the joints move at the last of them,
    by velocities of places and angular velocities (joints, 3), a second.
    """

    moments: np.ndarray
    poses: Poses
    velocities: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    spins: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))

    def at(self, moments: np.ndarray) -> Poses:
        """Return the poses at moments (n,), shape (joints, n). Before the first knot those of the first."""
        last = len(self.moments) - 1
        before = np.clip(np.searchsorted(self.moments, moments, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        span = np.where(after > before, self.moments[after] - self.moments[before], 1.0)
        share = np.clip((moments - self.moments[before]) / span, 0.0, 1.0)[:, None]
        beyond = carried(moments - self.moments[last])[:, None]
        first, second = self.poses[:, before], self.poses[:, after]
        slides = share * (second.positions - first.positions) + beyond * self.velocities[:, None]
        vectors = share * turns_between(first.quaternions, second.quaternions) + beyond * self.spins[:, None]
        return Poses(first.positions + slides, turned(first.quaternions, vectors))

    def pose(self, moment: float) -> Poses:
        """Return the poses of a moment, shape (joints,)."""
        return self.at(np.array([moment]))[:, 0]

    def followed(self, other: Path, lost: int = 0) -> Path:
        """Return this path until the start of another, and from there straight to the knots of that.

        Where as many windows between them are lost, the motion went on as it was going until the first of these, and
        what it did then is not known: it goes straight from there.
        """
        start = other.moments[0]
        start = max(start - lost * (other.moments[-1] - start), min(start, self.moments[-1]))
        kept = int(np.searchsorted(self.moments, start))
        moments = np.concatenate((self.moments[:kept], [start], other.moments[1:]))
        poses = joined((self.poses[:, :kept], self.at(np.array([start])), other.poses[:, 1:]), axis=1)
        return Path(moments, poses, other.velocities, other.spins)

    def extended(self, moment: float, poses: Poses) -> Path:
        """Return this path with another knot behind the others, of poses (joints,)."""
        return Path(np.append(self.moments, moment), joined((self.poses, poses[:, None]), axis=1))

    def going_on(self) -> Path:
        """Return the same, with the motion going on beyond the last knot as it went since the one before."""
        if len(self.moments) < 2:
            return self
        before, last, span = self.poses[:, -2], self.poses[:, -1], self.moments[-1] - self.moments[-2]
        spins = turns_between(before.quaternions, last.quaternions) / span
        return Path(self.moments, self.poses, (last.positions - before.positions) / span, spins)

    def since(self, moment: float) -> Path:
        """Return the same without knots that nothing from this moment on depends on."""
        kept = max(int(np.searchsorted(self.moments, moment, side="right")) - 1, 0)
        return Path(self.moments[kept:], self.poses[:, kept:], self.velocities, self.spins)
