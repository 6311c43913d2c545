"""Whole bodies as the fewest cubic curves: joint by joint from the roots on, within a tolerance in the roots' space.

What a joint may be off is shared out along the chain that it is in, by the lengths of bones. What those above it left
of their shares is left to it. A joint aims at where it should be in the roots' space, given its parent as its curves
have that; or it keeps to its own rotation, where that needs no more keys.
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
"""The share of the tolerance that is left for single precision."""

MIN_CHANNEL_TOLERANCE_RATIO = 1e-2
"""The least share of the tolerance that a channel is allowed, where those above it left nothing."""

CHAIN_SHARE_POWER = 0.5
"""The power of a joint's share of its chain that its share of the tolerance is: below 1 those above get more."""


@dataclass(frozen=True, eq=False)
class CurvedBody:
    """A body that is to get curves. Joints come first."""

    times: np.ndarray
    """Shape (m,), seconds."""

    skeleton: Skeleton
    truth: Poses
    """In the roots' space, shape (joints, m)."""

    local: Poses
    """As their parents have them, shape (joints, m). What gets no curves is as it is stored."""

    lengths: np.ndarray
    """How long the axes of local positions are in the roots' space, shape (joints, 1 or m, 3)."""

    radii: np.ndarray
    """Of the balls around joints, shape (joints,)."""

    curved: np.ndarray
    """Whether the location and the rotation of each joint get curves, shape (joints, 2)."""

    tolerance: np.ndarray
    """How far off any point of each ball may be at each sample, shape (joints, m)."""

    may_be_lines: bool = False
    """Whether lines and even turns take the place of curves that need as many keys."""

    @cached_property
    def carried(self) -> list[dict[int, float]]:
        """What turns with each joint, up to what turns by itself: joints, and how far they are from it at most."""
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
        """How much of the tolerance the places of joints may take, shape (joints,)."""
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
    """The curves of a joint; None of a channel that has none."""

    location: CubicKeys | None
    rotation: CubicKeys | None
    lines: int
    """How many keys lines would need."""


Channel = tuple[Samples, np.ndarray]
"""What a channel is to show, and its own values."""


def fitted_body(body: CurvedBody) -> list[JointCurves]:
    """Return the curves of all joints of a body, as few keys as there are found."""
    return _Fitting(body).done()


class _Fitting:
    def __init__(self, body: CurvedBody) -> None:
        self.body, self.parents = body, body.skeleton.parents
        self.allowed = (ROUNDING_TOLERANCE_RATIO - 1.0) * body.skeleton.most_below(-body.tolerance)
        shape = body.truth.shape
        self.shown = Poses(np.zeros((*shape, 3)), np.zeros((*shape, 4)))
        """In the roots' space, with curves."""

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
        samples, own = self._rotation(joint, self._off(joint))
        rotation, more = self._fewest(samples, own)
        if location is not None and len(location.times) != len(rotation.times):
            location, rotation = self._at_the_same_times(joint, location, rotation)
            self._move(joint, location)
        self._turn(joint, rotation)
        return JointCurves(location, rotation, lines + more)

    def _at_the_same_times(self, joint: int, location: CubicKeys, rotation: CubicKeys) -> tuple[CubicKeys, CubicKeys]:
        """Return both with keys at the same times where that takes no more of them."""
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
        """Where the joint itself is off by so much (m,)."""
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
        """Return the curves of a channel that need fewer keys, through its own values or others, and those of lines."""
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
        """Show the joint where these curves have it."""
        body, parent = self.body, self.parents[joint]
        positions = body.local.positions[joint] if location is None else values_at(location, body.times)
        positions = positions * body.lengths[joint]
        if parent >= 0:
            above = self.shown[parent]
            positions = above.positions + rotate(above.quaternions, positions)
        self.shown.positions[joint] = positions

    def _turn(self, joint: int, rotation: CubicKeys | None) -> None:
        """Show the joint turned as these curves have it."""
        body, parent = self.body, self.parents[joint]
        if rotation is None:
            turns = body.local.quaternions[joint]
        elif body.may_be_lines and is_of_lines(rotation):
            turns = turned_at(rotation.times, rotation.values, body.times)
        else:
            turns = normalise(values_at(rotation, body.times))
        self.shown.quaternions[joint] = turns if parent < 0 else multiply(self.shown.quaternions[parent], turns)

    def _off(self, joint: int) -> np.ndarray:
        return np.linalg.norm(self.shown.positions[joint] - self.body.truth.positions[joint], axis=-1)
