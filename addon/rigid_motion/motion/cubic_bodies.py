"""Cubic curves for whole bodies with few keys: joint by joint from the roots, within a tolerance in root space.

The tolerance is shared out along each chain of joints by the lengths of the bones. What the joints above leave of their
shares goes to the joints below. A joint aims at its recorded place in root space, given its parent as shown by the
parent's curves; or it keeps its own rotation, if that needs no more keys.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .cubic_keys import CubicKeys, Samples, fitted_together, is_of_lines, values_at
from .poses import Poses
from .quaternions import conjugate, multiply, normalise, rotate, turned_at
from .skeletons import Skeleton

ROUNDING_TOLERANCE_RATIO = 1e-3
"""Fraction of the tolerance that is left for the rounding of single precision."""

MIN_CHANNEL_TOLERANCE_RATIO = 1e-2
"""Smallest fraction of the tolerance for a channel, even if the joints above leave nothing."""

CHAIN_SHARE_POWER = 0.5
"""A joint gets its share of its chain to this power as its share of the tolerance: below 1, joints above get more."""


@dataclass(frozen=True, eq=False)
class CurvedBody:
    """A body to fit curves to. Joints are the first axis."""

    times: np.ndarray
    """Shape (m,), seconds."""

    skeleton: Skeleton
    truth: Poses
    """In root space, shape (joints, m)."""

    local: Poses
    """In the space of the parents, shape (joints, m). Channels without curves stay as they are here."""

    lengths: np.ndarray
    """Lengths of the axes of local positions in root space, shape (joints, 1 or m, 3)."""

    radii: np.ndarray
    """Radii of the balls around joints, shape (joints,)."""

    curved: np.ndarray
    """Whether the location and the rotation of each joint get curves, shape (joints, 2)."""

    tolerance: np.ndarray
    """How far off any point of each ball may be at each sample, shape (joints, m)."""

    may_be_lines: bool = False
    """Whether straight lines and constant-rate turns replace curves that need as many keys."""

    @cached_property
    def carried(self) -> list[dict[int, float]]:
        """For each joint, the joints it turns, down to the first that turn by themselves, with their greatest
        distance.
        """
        arms = np.linalg.norm(self.local.positions * self.lengths, axis=-1).max(axis=1)
        result: list[dict[int, float]] = [{} for _ in arms]
        for joint in np.concatenate(self.skeleton.levels)[::-1].tolist():
            parent = self.skeleton.parents[joint]
            if parent >= 0:
                below = {} if self.curved[joint, 1] else result[joint]
                result[parent] |= {joint: arms[joint]} | {other: arms[joint] + away for other, away in below.items()}
        return result

    @cached_property
    def shares(self) -> np.ndarray:
        """Fraction of the tolerance that the position of each joint may use, shape (joints,)."""
        moves, turns = self.curved.T
        levers = np.array(
            [
                max([radius, *(away + (0.0 if turns[other] else self.radii[other]) for other, away in own.items())])
                for radius, own in zip(self.radii, self.carried, strict=True)
            ]
        )
        own, turned = levers * moves, levers * turns
        above, below = own.copy(), turned.copy()
        for joints in self.skeleton.levels[1:]:
            parents = self.skeleton.parents[joints]
            above[joints] += above[parents] + turned[parents]
        for joints in self.skeleton.levels[:0:-1]:
            parents = self.skeleton.parents[joints]
            np.maximum.at(below, parents, turned[parents] + own[joints] + below[joints])
        whole = above + below
        return np.divide(above, whole, out=np.ones(len(whole)), where=whole > 0.0) ** CHAIN_SHARE_POWER


class JointCurves(NamedTuple):
    """The curves of a joint; None for a channel without any."""

    location: CubicKeys | None
    rotation: CubicKeys | None
    lines: int
    """Number of keys that lines would need."""


Channel = tuple[Samples, np.ndarray]
"""The samples that a channel aims at, and its own values."""


def fitted_body(body: CurvedBody) -> list[JointCurves]:
    """Return the curves of all joints of a body, with as few keys as can be found."""
    return _Fitting(body).done()


class _Fitting:
    def __init__(self, body: CurvedBody) -> None:
        self.body, self.parents = body, body.skeleton.parents
        self.allowed = (ROUNDING_TOLERANCE_RATIO - 1.0) * body.skeleton.most_below(-body.tolerance)
        shape = body.truth.shape
        self.shown = Poses(np.zeros((*shape, 3)), np.zeros((*shape, 4)))
        """The body as its curves show it, in root space."""

    def done(self) -> list[JointCurves]:
        order = np.concatenate(self.body.skeleton.levels).tolist()
        curves = {joint: self._joint(joint) for joint in order}
        return [curves[joint] for joint in range(len(order))]

    def _joint(self, joint: int) -> JointCurves:
        moves, turns = self.body.curved[joint].tolist()
        location, lines = self._fewest(*self._location(joint)) if moves else (None, 0)
        self._move(joint, location)
        if not turns:
            self._turn(joint, None)
            return JointCurves(location, None, lines)
        samples, own = self._rotation(joint, self._position_errors(joint))
        rotation, more = self._fewest(samples, own)
        if location is not None and len(location.times) != len(rotation.times):
            location, rotation = self._at_the_same_times(joint, location, rotation)
            self._move(joint, location)
        self._turn(joint, rotation)
        return JointCurves(location, rotation, lines + more)

    def _at_the_same_times(self, joint: int, location: CubicKeys, rotation: CubicKeys) -> tuple[CubicKeys, CubicKeys]:
        """Return both curves with keys at the same times, if that takes no more keys."""
        most = self.body.shares[joint] * self.allowed[joint]
        groups = [self._location(joint)[0], self._rotation(joint, most)[0]]
        first, second = fitted_together(self.body.times, groups)
        is_better = len(first.times) + len(second.times) <= len(location.times) + len(rotation.times)
        return (first, second) if is_better else (location, rotation)

    def _location(self, joint: int) -> Channel:
        body, parent, aims = self.body, self.parents[joint], self.body.truth.positions[joint]
        if parent >= 0:
            above = self.shown[parent]
            aims = rotate(conjugate(above.quaternions), aims - above.positions)
        lengths = body.lengths[joint]
        allowed = body.shares[joint] * self.allowed[joint] / lengths.max(axis=-1)
        return Samples(aims / lengths, allowed), body.local.positions[joint]

    def _rotation(self, joint: int, off: np.ndarray) -> Channel:
        """Return the rotation channel of a joint whose position is off by `off` (m,)."""
        body, parent, aims = self.body, self.parents[joint], self.body.truth.quaternions[joint]
        if parent >= 0:
            aims = multiply(conjugate(self.shown.quaternions[parent]), aims)
        least = MIN_CHANNEL_TOLERANCE_RATIO * self.allowed[joint]
        allowed = np.maximum(self.allowed[joint] - off, least) / body.radii[joint]
        for other, away in body.carried[joint].items():
            if not body.curved[other, 1]:
                farthest = away + body.radii[other]
                allowed = np.minimum(allowed, np.maximum(self.allowed[other] - off, least) / farthest)
            if away > 0.0:
                most = body.shares[other] * self.allowed[other]
                allowed = np.minimum(allowed, np.maximum(most - off, least) / away)
        return Samples(aims, allowed / 2.0, are_turns=True), body.local.quaternions[joint]

    def _fewest(self, aiming: Samples, own: np.ndarray) -> tuple[CubicKeys, int]:
        """Return a channel's curves with the fewest keys, through the aims or its own values, and the keys of lines."""
        times = self.body.times
        (best,) = fitted_together(times, [aiming])
        kept = fitted_together(times, [Samples(own, aiming.allowed, aiming.are_turns, aiming.values)])
        if kept and len(kept[0].times) <= len(best.times):
            (best,) = kept
        if not self.body.may_be_lines:
            return best, 0
        (lines,) = fitted_together(times, [aiming], lines=True)
        return lines if len(lines.times) <= len(best.times) else best, len(lines.times)

    def _move(self, joint: int, location: CubicKeys | None) -> None:
        """Place the joint as these curves do."""
        body, parent = self.body, self.parents[joint]
        positions = body.local.positions[joint] if location is None else values_at(location, body.times)
        positions = positions * body.lengths[joint]
        if parent >= 0:
            above = self.shown[parent]
            positions = above.positions + rotate(above.quaternions, positions)
        self.shown.positions[joint] = positions

    def _turn(self, joint: int, rotation: CubicKeys | None) -> None:
        """Turn the joint as these curves do."""
        body, parent = self.body, self.parents[joint]
        if rotation is None:
            turns = body.local.quaternions[joint]
        elif body.may_be_lines and is_of_lines(rotation):
            turns = turned_at(rotation.times, rotation.values, body.times)
        else:
            turns = normalise(values_at(rotation, body.times))
        self.shown.quaternions[joint] = turns if parent < 0 else multiply(self.shown.quaternions[parent], turns)

    def _position_errors(self, joint: int) -> np.ndarray:
        return np.linalg.norm(self.shown.positions[joint] - self.body.truth.positions[joint], axis=-1)
