"""Paths: what is shown of some messages, at any moment.

All joints share the moments of their knots. Between two knots places go straight and turns go about one axis; beyond
the last knot the motion goes on as it was going, and comes to rest. Rotation vectors are radians in the joint's own
axes. Seconds.

Where somebody takes a body in hand, or lets go of it, two knots are at one moment: the last in the one space, and the
first in the other, so that nothing is ever between numbers of two spaces.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import turned, turns_between

CARRY_S = 0.15
"""Seconds: a motion of velocity v goes on by v * CARRY_S * (1 - exp(-t / CARRY_S)) beyond the last knot."""

Side = Literal["left", "right"]


def carried(after: np.ndarray | float) -> np.ndarray:
    """By how many seconds of its velocity a motion goes on, so many seconds after its last knot."""
    return np.asarray(CARRY_S * -np.expm1(-np.maximum(after, 0.0) / CARRY_S))


@dataclass(frozen=True, eq=False)
class KnotPath:
    """Knots of all joints: rising moments (knots,), poses (joints, knots), and how the joints move at the last of them,
    by velocities of places and angular velocities (joints, 3), a second.

    `holders` has the joint that holds each at each knot, whose space its pose is in, shape (joints, knots); -1 for what
    is in its own parent's space.
    """

    moments: np.ndarray
    poses: Poses
    velocities: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    spins: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    holders: np.ndarray = field(default_factory=lambda: np.full((1, 1), -1, dtype=np.int16))

    def __post_init__(self) -> None:
        holders = np.broadcast_to(self.holders, (len(self.holders), len(self.moments)))
        object.__setattr__(self, "holders", holders)

    def _before(self, moments: np.ndarray, side: Side) -> np.ndarray:
        """Return the last knots that are not after moments (n,) or, from the left, the last before them."""
        return np.clip(np.searchsorted(self.moments, moments, side=side) - 1, 0, len(self.moments) - 1)

    def at(self, moments: np.ndarray, side: Side = "right") -> Poses:
        """Return the poses at moments (n,), shape (joints, n). Before the first knot those of the first.

        Where a body changes hands, they are those from that moment on or, from the left, until then.
        """
        last, before = len(self.moments) - 1, self._before(moments, side)
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
        """Return the poses of a moment, shape (joints,)."""
        return self.at(np.array([moment]))[:, 0]

    def held_at(self, moment: float) -> np.ndarray:
        """Return which joint holds each at a moment, shape (joints,); a single -1 where nothing is ever held."""
        return self.holders[:, self._before(np.array([moment]), "right")[0]]

    def followed(self, other: KnotPath, lost: int = 0) -> KnotPath:
        """Return this path until the start of another, and from there straight to the knots of that.

        Where as many windows between them are lost, the motion went on as it was going until the first of these, and
        what it did then is not known: it goes straight from there.

        What is in other hands from the start of the other path on is there as that has it, and until then as it was.
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
            # It is in the old hands up to the last knot before, or beyond all knots.
            until = self.holders[:, self._before(begin, "left")]
            if (until != holders).any():
                moments.insert(1, begin)
                poses.insert(1, self.at(begin, "left"))
                held.insert(1, until)
        return KnotPath(
            np.concatenate(moments), joined(poses, axis=1), other.velocities, other.spins, np.concatenate(held, axis=1)
        )

    def extended(self, moment: float, poses: Poses) -> KnotPath:
        """Return this path with another knot behind the others, of poses (joints,), with nothing ever held."""
        return KnotPath(np.append(self.moments, moment), joined((self.poses, poses[:, None]), axis=1))

    def going_on(self) -> KnotPath:
        """Return the same, with the motion going on beyond the last knot as it went since the one before."""
        if len(self.moments) < 2:
            return self
        before, last, span = self.poses[:, -2], self.poses[:, -1], self.moments[-1] - self.moments[-2]
        spins = turns_between(before.quaternions, last.quaternions) / span
        return KnotPath(self.moments, self.poses, (last.positions - before.positions) / span, spins, self.holders)

    def since(self, moment: float) -> KnotPath:
        """Return the same without knots that nothing from this moment on depends on."""
        kept = max(int(np.searchsorted(self.moments, moment, side="right")) - 1, 0)
        return KnotPath(self.moments[kept:], self.poses[:, kept:], self.velocities, self.spins, self.holders[:, kept:])
