"""Turning: rotation between keys beyond the shortest way, by angle channels or by whole turns of the Turns channel.

An angle about the same axis at both keys says how far the body turns. So do Euler angles: the axis that turns furthest
in a segment counts if it turns more than half a turn, and whole turns are added to the shortest rotation until it
matches that angle. At half a turn there are two shortest ways, and the sign of the angle decides. The axis is fixed in
the body if the angles that precede it change less, and in space otherwise. The Turns channel comes on top. Inserted
keys may leave fractions of turns in it: a fraction is taken off the rotation to the second key, and made by the spin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...motion import Poses, twists
from ...motion.eulers import quaternions_from_extrinsic_eulers
from ...motion.quaternions import conjugate, normalise, rotate
from ...motion.spins import FULL_TURN, Spins
from .bodies import body_poses
from .components import AXIS_ANGLE, ROTATION, ROWS
from .marks import HALF_TURN, SAME_VALUE, SCREW_AXIS, sweeps
from .sources import KeyedTransform

NO_TURN = 1e-4
"""A rotation by less than this angle, in radians, has no axis."""


@dataclass(frozen=True, eq=False)
class Turning:
    """How S segments turn."""

    spins: Spins

    by_angles: Spins
    """Spins from the angles of the channels alone."""

    first: np.ndarray
    """The quaternions of the first keys, shape (S, 4)."""

    second: np.ndarray
    """The rotations that segments reach without spins: the second keys, less any fractional turns of the spins. Their
    signs say which way round, shape (S, 4)."""

    turn: np.ndarray
    """The rotation from `first` to `second` as a vector along the axes of the body, shape (3, S)."""

    @cached_property
    def twists(self) -> np.ndarray:
        """The angular velocities that spins add at both ends in unit time, along the body's axes, shape (3, 2, S)."""
        return self.spins.twists(self.first, self.second)

    @property
    def totals(self) -> np.ndarray:
        """The total rotation of each segment, in radians, shape (S,)."""
        return np.linalg.norm(self.turn + self.twists[:, 0], axis=0)

    @property
    def about(self) -> np.ndarray:
        """The rotation of each segment about the axis of its spin, in radians, shape (S,)."""
        return np.einsum("ks,ks->s", self.turn + self.twists[:, 0], self.axes_in_body)

    @property
    def axes_in_body(self) -> np.ndarray:
        """The axes of spins, along those of the body at the first key, shape (3, S)."""
        return replace(self.spins, turns=np.ones(len(self.first))).twists(self.first, self.second)[:, 0] / FULL_TURN


def needs_turning(source: KeyedTransform) -> bool:
    """Return whether any segment may turn other than by the shortest way."""
    return source.has_half_turns or source.turns is not None


def turning(
    start: np.ndarray,
    end: np.ndarray,
    keys: Poses,
    original: np.ndarray,
    order: str | None,
    turns: np.ndarray,
    axes: np.ndarray,
    backwards: np.ndarray,
) -> Turning:
    """Return how S segments turn.

    Takes the channels (., S) at both ends, their poses (S, 2), and the rotations (S, 4) of the objects' delta
    transforms. `turns` (S,) are from the Turns channel: a fraction is part of the rotation to the second key. `axes`
    (S,), from `TURN_AXES`, are the axes of the turns; `backwards` (S,) says whether time runs backwards.
    """
    first, count = keys.quaternions[:, 0], len(turns)
    second, turn = _shortest(first, keys.quaternions[:, 1])
    spins = Spins(np.zeros(count), np.zeros((3, count)), np.zeros(count, dtype=bool))
    result, senses = Turning(spins, spins, first, second, turn), np.zeros(count)
    parts = turns - np.rint(turns)
    if order is not None:
        senses = _add_angles(result, start[ROWS[ROTATION]], end[ROWS[ROTATION]], original, order, parts)
    result = replace(result, by_angles=replace(spins, turns=spins.turns.copy()))
    _add_channel(result, turns, senses, axes, backwards)
    return result


def turning_of(
    sources: Sequence[KeyedTransform], start: np.ndarray, end: np.ndarray, keys: Poses, original: np.ndarray
) -> tuple[Turning, Turning]:
    """Return how S segments of similar sources turn, and the same with whole turns only.

    Takes their channels (10, S) and poses (S, 2) at both ends, and the objects' own delta transforms (10, S).
    """
    turns = np.concatenate([source.segment_turns for source in sources])
    backwards = np.concatenate([source.run_backwards for source in sources])
    axes = np.concatenate([source.axes_of_turns for source in sources])
    given = (start, end, keys, original[ROWS[ROTATION]].T, sources[0].order)
    result = turning(*given, turns, axes, backwards)
    if np.all(turns == np.rint(turns)):
        return result, result
    # Fractional turns go the shortest way between the keys, as without the Turns channel.
    by_angles, spins = turning(*given, np.zeros_like(turns), axes, backwards), result.spins
    lacking = result.about - np.einsum("ks,ks->s", by_angles.turn, result.axes_in_body)
    whole = np.where(spins.turns == np.rint(spins.turns), spins.turns, np.rint(lacking / FULL_TURN))
    return result, replace(by_angles, spins=replace(spins, turns=whole))


def turning_in(source: KeyedTransform, segment: int, turns: float | None = None) -> Turning:
    """Return how one segment of a source turns, with `turns` instead of those of its channel if given."""
    rows, original, one = values_at_ends(source, segment), source.original[:, None], slice(segment, segment + 1)
    poses = body_poses(rows[:, None], original[..., None], None, source)
    channel = source.segment_turns[one] if turns is None else np.array([turns])
    own = original[ROWS[ROTATION]].T
    axes, backwards = source.axes_of_turns[one], np.zeros(1, dtype=bool)
    return turning(rows[:, :1], rows[:, 1:], poses, own, source.order, channel, axes, backwards)


def values_at_ends(source: KeyedTransform, segment: int) -> np.ndarray:
    """Return the channel values at both ends of a segment, (10, 2)."""
    return source.values_at(source.key_frames[segment : segment + 2])


def shortest_turns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the shortest rotations (3, S) from quaternions (S, 4) to others."""
    nowhere = np.zeros((len(first), 3))
    return twists.between(nowhere, first, nowhere, second)[:3]


def _shortest(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the second quaternions (S, 4), signed for the shortest way from the first, and the rotations (3, S)."""
    signs = np.where(np.einsum("si,si->s", first, second) < 0.0, -1.0, 1.0)
    return second * signs[:, None], shortest_turns(first, second)


def _subtract_fractions(result: Turning, some: np.ndarray, parts: np.ndarray) -> None:
    """Subtract the fractional turns (s,) of some segments' spins from the rotations they reach, in place."""
    if parts.any():
        spins = Spins(-parts, result.spins.axes[:, some], result.spins.in_space[some])
        ends = Poses(np.zeros((len(some), 3)), result.second[some])
        turned = spins.add_to(ends, np.ones(len(some), dtype=int), np.ones(len(some))).quaternions
        result.second[some], result.turn[:, some] = _shortest(result.first[some], turned)


def _add_angles(
    result: Turning,
    start: np.ndarray,
    end: np.ndarray,
    original: np.ndarray,
    order: str,
    parts: np.ndarray,
) -> np.ndarray:
    """Add the turns given by angles (4, S) at both ends, and make half turns follow the sign of the angle, in place.

    `parts` (S,) are the fractional turns of the channel: that much of the angles is spin. Returns the sign of the angle
    that counts, 0 if none does, shape (S,).
    """
    senses, spins = np.zeros(len(parts)), result.spins
    if order == AXIS_ANGLE:
        by = sweeps(start, end)
    else:
        change = (end - start)[:3]
        furthest = np.abs(change).argmax(axis=0)
        by = np.take_along_axis(change, furthest[None], axis=0)[0]
    # An angle that changes only by rounding has no sign.
    some = np.flatnonzero((np.abs(by) >= HALF_TURN) | ((parts != 0.0) & (np.abs(by) > SAME_VALUE)))
    if not len(some):
        return senses
    by, sense = by[some], np.sign(by[some])
    if order == AXIS_ANGLE:
        axes = normalise(start[1:, some].T)
        stands = np.zeros(len(some), dtype=bool)
    else:
        in_body, in_space = (
            np.stack([_axis(angles[:3, some], furthest[some], order, before=before) for angles in (start, end)])
            for before in (True, False)
        )
        moved, turned = (np.linalg.norm(np.diff(both, axis=0)[0], axis=1) for both in (in_space, in_body))
        stands = moved < turned
        axes = np.where(stands[:, None], rotate(original[some], _mean(in_space)), _mean(in_body))
    spins.axes[:, some], spins.in_space[some] = axes.T, stands
    part = sense * parts[some]
    _subtract_fractions(result, some, part)
    turn, by = result.turn[:, some], by - FULL_TURN * part
    about = np.einsum("sk,sk->s", axes, np.where(stands[:, None], rotate(result.first[some], turn.T), turn.T))
    # Half a turn has two shortest ways, and rounding errors would choose one of them.
    size = np.linalg.norm(turn, axis=0)
    is_half = np.abs(np.abs(by - FULL_TURN * np.rint(by / FULL_TURN)) - np.pi) <= np.pi - HALF_TURN
    other = is_half & (size >= HALF_TURN) & (about * sense < -1.0)
    factor = np.where(other, 1.0 - FULL_TURN / np.maximum(size, 1.0), 1.0)
    result.turn[:, some] *= factor
    result.second[some] *= np.where(other, -1.0, 1.0)[:, None]
    turns = np.where(
        (np.abs(by) > FULL_TURN - HALF_TURN) | (part != 0.0), np.rint((by - about * factor) / FULL_TURN), 0
    )
    spins.turns[some] = turns
    senses[some] = np.where((turns != 0) | (part != 0.0), sense, 0.0)
    return senses


def _axis(angles: np.ndarray, axis: np.ndarray, order: str, *, before: bool) -> np.ndarray:
    """Return an axis of each triple of Euler angles (3, S), (S, 3): in the body (turns `before` it), or in space."""
    result = np.eye(3)[axis]
    turn = np.array([order.index(name) for name in "XYZ"])
    others = turn[:, None] < turn[axis] if before else turn[:, None] > turn[axis]
    turned = quaternions_from_extrinsic_eulers(np.where(others, angles, 0.0).T, order)
    return rotate(conjugate(turned) if before else turned, result)


def _mean(ends: np.ndarray) -> np.ndarray:
    """Return the unit vector (S, 3) half-way between two (2, S, 3), or the first one if they are opposite."""
    total = ends.sum(axis=0)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > NO_TURN, total / np.maximum(length, NO_TURN), ends[0])


def _add_channel(
    result: Turning, turns: np.ndarray, senses: np.ndarray, axes: np.ndarray, backwards: np.ndarray
) -> None:
    """Add the turns of the channel, in place: about the axis of the angles' turns if these have a sign (S,)."""
    spins, others = result.spins, np.flatnonzero((turns != 0.0) & (senses == 0.0))
    spins.turns[:] += senses * turns
    if not len(others):
        return
    size = np.linalg.norm(result.turn[:, others], axis=0)
    is_local = (axes[others] != SCREW_AXIS) | (size < NO_TURN)
    # A segment without an axis of its own turns about Z, the last of the axes.
    local = np.eye(3)[:, ["XYZ".find(name) for name in axes[others]]]
    spins.axes[:, others] = np.where(is_local, local, result.turn[:, others] / np.maximum(size, NO_TURN))
    spins.in_space[others] = False
    added = np.where(is_local & backwards[others], -1, 1) * turns[others]
    spins.turns[others] += added
    _subtract_fractions(result, others, added - np.rint(added))


def without_spins(measured: Poses, spins: Spins, progress: np.ndarray) -> Poses:
    """Return poses (S, k) at this progress (S, k) of S segments with the segments' spins removed."""
    counts = np.full(len(progress), progress.shape[1])
    flat = Poses(measured.positions.reshape(-1, 3), measured.quaternions.reshape(-1, 4))
    unspun = replace(spins, turns=-spins.turns).add_to(flat, counts, progress.ravel())
    return replace(measured, quaternions=unspun.quaternions.reshape(measured.quaternions.shape))
