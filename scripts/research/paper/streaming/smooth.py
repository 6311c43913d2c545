"""Keys with twists: how a body moves is sent along with where it is, and the motion between two keys bends to both.

A key with its twist stands for itself: what is shown after it, until the next one is there, needs no key before it, and
the next one needs no key after it for the motion to flow through both. Seconds and the unit of the positions
throughout; a twist has the angular velocity and the velocity of the origin along the body's own axes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import MODES, Poses, twists
from rigid_motion.motion.modes import no_such_mode
from rigid_motion.motion.quaternions import multiply, rotate

TWISTS = "motor_twists"
"""What fills in between keys that have twists, where a mode has a name."""

LEAST = 3
"""Samples that a parabola is put through by least squares, at least."""


@dataclass(frozen=True)
class Reach:
    """The keys that have a say in a segment besides its own two."""

    behind: int
    ahead: int

    @property
    def before(self) -> int:
        """The keys that are looked at before the two: at least 1, for going on beyond the newest key."""
        return max(self.behind, 1)

    @property
    def lead(self) -> float:
        """Update intervals before the play-out gets to a key by which it has to be there: as little as will do."""
        return 1.0 + self.ahead


def reach_of(mode: str) -> Reach:
    """How far a mode of a stream looks: one of `MODES`, or `TWISTS`. Raises ValueError for another."""
    if mode == TWISTS:
        return Reach(0, 0)
    if mode not in MODES:
        raise ValueError(no_such_mode(mode, (*MODES, TWISTS)))
    return Reach(MODES[mode].behind, MODES[mode].ahead)


NO_POSES = Poses(np.empty((0, 3)), np.empty((0, 4)))


def joined(parts: Iterable[Poses]) -> Poses:
    """Poses without scales, one after the other."""
    parts = list(parts)
    return Poses(
        np.concatenate([part.positions for part in parts]), np.concatenate([part.quaternions for part in parts])
    )


def moved(poses: Poses, ways: np.ndarray) -> Poses:
    """Poses (n,) after the motions of twists (6, n), in the bodies' own axes."""
    turns, advances = twists.exponential(ways)
    return Poses(poses.positions + rotate(poses.quaternions, advances.T), multiply(poses.quaternions, turns.T))


def between(
    first: Poses,
    second: Poses,
    leaving: np.ndarray,
    arriving: np.ndarray,
    durations: np.ndarray,
    progress: np.ndarray,
) -> Poses:
    """The poses between keys that have twists.

    Parameters
    ----------
    first, second : Poses, shape (n,)
        The keys before and after each.
    leaving, arriving : array, shape (n, 6)
        Their twists.
    durations : array, shape (n,)
        From the one to the other.
    progress : array, shape (n,)
        From 0 at the first to 1 at the second.

    Returns
    -------
    Poses, shape (n,)
        M exp(u r) exp(u (1 - u)^2 (w - r) - u^2 (1 - u) (w' - r)), as `motion.curves` has it for smooth screws:
        the screw r from key to key, bent so that the body has the twists w and w' at the keys.
    """
    way = twists.between(first.positions, first.quaternions, second.positions, second.quaternions)
    rest = 1.0 - progress
    bend = progress * rest**2 * (leaving.T * durations - way) - progress**2 * rest * (arriving.T * durations - way)
    return moved(moved(first, progress * way), bend)


def fitted(times: np.ndarray, poses: Poses, at: np.ndarray, last: int, half: float) -> tuple[Poses, np.ndarray]:
    """Where a body is at samples of a recording, and how it moves there, of the samples around.

    Parameters
    ----------
    times : array, shape (n,)
    poses : Poses, shape (n,)
        Of the recording.
    at : array of int, shape (c,)
        The samples that are asked for.
    last : int
        The last sample that is known.
    half : float
        Samples that are further away than this are not looked at, unless there are too few.

    Returns
    -------
    poses : Poses, shape (c,)
    twists : array, shape (c, 6)
        Of the parabola through the samples around each, by least squares on twists from the pose itself. Where there
        are too few samples for that, the pose as it was recorded and the twist from the sample before.
    """
    begins = np.minimum(np.searchsorted(times, times[at] - half), np.maximum(at - LEAST + 1, 0))
    ends = np.minimum(np.maximum(np.searchsorted(times, times[at] + half, side="right"), begins + LEAST), last + 1)
    begins = np.maximum(np.minimum(begins, ends - LEAST), 0)
    counts = ends - begins
    rows = begins[:, None] + np.arange(int(counts.max()))
    used = rows < ends[:, None]
    rows = np.where(used, rows, at[:, None])
    centre = poses[np.repeat(at, rows.shape[1])]
    there = poses[rows.ravel()]
    ways = twists.between(centre.positions, centre.quaternions, there.positions, there.quaternions)
    ways = ways.reshape(6, *rows.shape).transpose(1, 2, 0)
    # In units of the window, so that the equations are of one size.
    scale = np.maximum(np.abs(np.where(used, times[rows] - times[at][:, None], 0.0)).max(axis=1), 1e-12)
    powers = np.vander(((times[rows] - times[at][:, None]) / scale[:, None]).ravel(), 3, increasing=True)
    powers = powers.reshape(*rows.shape, 3) * used[..., None]
    normal = np.einsum("cwi,cwj->cij", powers, powers)
    solved = np.zeros((len(at), 3, 6))
    enough = counts >= LEAST
    if enough.any():
        solved[enough] = np.linalg.solve(normal[enough], np.einsum("cwi,cwk->cik", powers, ways)[enough])
    few = np.flatnonzero(~enough)
    for row in few:  # At the very beginning of a recording.
        own = int(at[row])
        other = own - 1 if own else min(own + 1, last)
        if other != own:
            pair = poses[[own, other]]
            way = twists.between(pair.positions[:1], pair.quaternions[:1], pair.positions[1:], pair.quaternions[1:])
            solved[row, 1] = way[:, 0] * scale[row] / (times[other] - times[own])
    return moved(poses[at], solved[:, 0].T), solved[:, 1] / scale[:, None]
