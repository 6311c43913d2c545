"""How far bodies turn between their keys beyond the shortest way: by whole turns, of Euler angles or of the channel.

Euler angles say how far: of the axis that goes furthest in a segment, if that is more than half a turn, as many turns
are added to the shortest rotation as it lacks of the angle; at half a turn, which has two shortest ways, the sense of
the angle decides. The axis stands still in the body where the angles turned about before it change less, and else in
space. What the channel of turns has comes on top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...motion import Poses, twists
from ...motion.eulers import quaternions_from_extrinsic_eulers
from ...motion.quaternions import conjugate, rotate
from ...motion.spins import FULL_TURN, Spins
from .bodies import body_poses
from .components import ROTATION, ROWS
from .sources import HALF_TURN, SCREW_AXIS, Source

NO_TURN = 1e-4
"""Radians: what turns by less has no axis."""

MOMENT = 1e-3
"""A time too short to see, in frames."""


@dataclass(frozen=True, eq=False)
class Turning:
    """How S segments turn."""

    spins: Spins

    by_angles: Spins
    """Those of them that the angles of the channels make by themselves."""

    signs: np.ndarray
    """By what to multiply the second quaternion of a segment for the way round that it turns, shape (S,)."""

    turn: np.ndarray
    """The rotation that is left without spins, as a vector along the axes of the body, shape (3, S)."""

    twists: np.ndarray
    """The angular velocities that spins add at both ends in unit time, along the body's axes, shape (3, 2, S)."""

    @property
    def totals(self) -> np.ndarray:
        """By how much each segment turns, in radians, shape (S,)."""
        return np.linalg.norm(self.turn + self.twists[:, 0], axis=0)


def needs_turning(source: Source) -> bool:
    """Whether any segment may turn otherwise than by the shortest way."""
    return source.has_half_turns or source.turns is not None


def turning(
    start: np.ndarray,
    end: np.ndarray,
    keys: Poses,
    own: np.ndarray,
    order: str | None,
    turns: np.ndarray,
    axes: np.ndarray,
    backwards: np.ndarray,
) -> Turning:
    """Return how S segments turn.

    Parameters
    ----------
    start, end : array, shape (., S)
        The channels at both ends.
    keys : Poses, shape (S, 2)
        What they make of the body.
    own : array, shape (S, 4)
        The rotations of the objects' own delta transforms, which the channels' are turned by.
    order : str or None
        Of the Euler angles, None for quaternions.
    turns : array of int, shape (S,)
        What the channel of turns has.
    axes : array of str, shape (S,)
        Of `TURN_AXES`, what they are about.
    backwards : array of bool, shape (S,)
        Whether time runs backwards.
    """
    first, second = keys.quaternions[:, 0], keys.quaternions[:, 1]
    signs = np.where(np.einsum("si,si->s", first, second) < 0.0, -1.0, 1.0)
    turn = shortest_turns(first, second)
    spins = Spins(np.zeros(len(turns), dtype=int), np.zeros((3, len(turns))), np.zeros(len(turns), dtype=bool))
    if order is not None:
        _add_angles(spins, turn, signs, start[ROWS[ROTATION]][:3], end[ROWS[ROTATION]][:3], first, own, order)
    by_angles = replace(spins, turns=spins.turns.copy())
    _add_channel(spins, turn, turns, axes, backwards)
    return Turning(spins, by_angles, signs, turn, spins.twists(first, second))


def turning_of(sources: Sequence[Source], start: np.ndarray, end: np.ndarray, keys: Poses, own: np.ndarray) -> Turning:
    """Return how S segments of alike sources turn, from their channels (10, S) and poses (S, 2) at both ends."""
    turns, backwards = (
        np.concatenate(parts)
        for parts in (
            [source.segment_turns for source in sources],
            [source.run_backwards for source in sources],
        )
    )
    axes = np.repeat([source.turns_axis for source in sources], [len(source.segment_turns) for source in sources])
    return turning(start, end, keys, own[ROWS[ROTATION]].T, sources[0].order, turns, axes, backwards)


def turning_in(source: Source, segment: int, turns: int | None = None) -> Turning:
    """Return how one of the segments of a source turns, with other turns than those of its channel if so given."""
    keys, own = source.key_frames[segment : segment + 2], source.original[:, None]
    # As seen from within the segment where cycles jump.
    rows = source.values_at(keys if source.cyclic is None else keys + np.array((MOMENT, -MOMENT)))
    start, end = rows[:, :1], rows[:, 1:]
    poses = body_poses(rows[:, None], own[..., None], None, source)
    at = slice(segment, segment + 1)
    channel = source.segment_turns[at] if turns is None else np.array([turns])
    axes, backwards = np.array([source.turns_axis]), source.run_backwards[at]
    return turning(start, end, poses, own[ROWS[ROTATION]].T, source.order, channel, axes, backwards)


def shortest_turns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The shortest turns (3, S) from quaternions (S, 4) to others."""
    nowhere = np.zeros((len(first), 3))
    return twists.between(nowhere, first, nowhere, second)[:3]


def _add_angles(
    spins: Spins,
    turn: np.ndarray,
    signs: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    first: np.ndarray,
    own: np.ndarray,
    order: str,
) -> None:
    """Add the turns that Euler angles (3, S) at both ends say, and have half turns go in their sense; in place."""
    change = end - start
    furthest = np.abs(change).argmax(axis=0)
    by = np.take_along_axis(change, furthest[None], axis=0)[0]
    some = np.flatnonzero(np.abs(by) >= HALF_TURN)
    if not len(some):
        return
    by, furthest = by[some], furthest[some]
    in_body, in_space = (
        np.stack([_axis(angles[:, some], furthest, order, before=before) for angles in (start, end)])
        for before in (True, False)
    )
    stands = np.linalg.norm(np.diff(in_space, axis=0)[0], axis=1) < np.linalg.norm(np.diff(in_body, axis=0)[0], axis=1)
    axes = np.where(stands[:, None], rotate(own[some], _mean(in_space)), _mean(in_body))
    about = np.einsum(
        "sk,sk->s", axes, np.where(stands[:, None], rotate(first[some], turn[:, some].T), turn[:, some].T)
    )
    # Half a turn has two shortest ways, and rounding errors would choose one of them.
    sense, size = np.sign(by), np.linalg.norm(turn[:, some], axis=0)
    is_half = np.abs(np.abs(by - FULL_TURN * np.rint(by / FULL_TURN)) - np.pi) <= np.pi - HALF_TURN
    other = is_half & (size >= HALF_TURN) & (about * sense < -1.0)
    factor = np.where(other, 1.0 - FULL_TURN / np.maximum(size, 1.0), 1.0)
    turn[:, some] *= factor
    signs[some] *= np.where(other, -1.0, 1.0)
    lacking = np.rint((by - about * factor) / FULL_TURN).astype(int)
    spins.turns[some] = np.where(np.abs(by) > FULL_TURN - HALF_TURN, lacking, 0)
    spins.axes[:, some], spins.in_space[some] = axes.T, stands


def _axis(angles: np.ndarray, axis: np.ndarray, order: str, *, before: bool) -> np.ndarray:
    """One of the axes of Euler angles (3, S) for each, (S, 3): as it is in the body, `before` the other turns, or in
    the space around it."""
    found = np.eye(3)[axis]
    place = np.array([order.index(name) for name in "XYZ"])
    others = place[:, None] < place[axis] if before else place[:, None] > place[axis]
    turned = quaternions_from_extrinsic_eulers(np.where(others, angles, 0.0).T, order)
    return rotate(conjugate(turned) if before else turned, found)


def _mean(ends: np.ndarray) -> np.ndarray:
    """The unit vector (S, 3) half-way between two (2, S, 3), the first one where they are opposite."""
    total = ends.sum(axis=0)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > NO_TURN, total / np.maximum(length, NO_TURN), ends[0])


def _add_channel(spins: Spins, turn: np.ndarray, turns: np.ndarray, axes: np.ndarray, backwards: np.ndarray) -> None:
    """Add what the channel has, in place: about the axis of the angles' own turns where there are any."""
    some = np.flatnonzero(turns)
    if not len(some):
        return
    by_angles, size = spins.turns[some], np.linalg.norm(turn[:, some], axis=0)
    is_local = (axes[some] != SCREW_AXIS) | (size < NO_TURN)
    # What has no axis of its own turns about the last of them, Z.
    local = np.eye(3)[:, ["XYZ".find(name) for name in axes[some]]]
    new = np.where(is_local, local, turn[:, some] / np.maximum(size, NO_TURN))
    sense = np.where(is_local & backwards[some], -1, 1)
    spins.axes[:, some] = np.where(by_angles != 0, spins.axes[:, some], new)
    spins.in_space[some] &= by_angles != 0
    spins.turns[some] += np.where(by_angles != 0, np.sign(by_angles), sense) * turns[some]


def without_spins(measured: Poses, spins: Spins, progress: np.ndarray) -> Poses:
    """Return poses (S, k) at this progress (S, k) of S segments without the spins that they have."""
    counts = np.full(len(progress), progress.shape[1])
    flat = Poses(measured.positions.reshape(-1, 3), measured.quaternions.reshape(-1, 4))
    unspun = replace(spins, turns=-spins.turns).add_to(flat, counts, progress.ravel())
    return replace(measured, quaternions=unspun.quaternions.reshape(measured.quaternions.shape))
