"""Separate keys for the rotation and location of joints: each joint is split into two nodes, in modes that allow it.

A node that only translates is the parent of a node that only turns, and the joint's children become children of the
latter. The motion stays the same if neither channel depends on the other between keys. The key search for bodies then
finds the keys of channels. A joint with a channel that never changes stays a single node, and so does a fixed joint.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from .bodies import Body
from .modes import MODES
from .poses import Poses, joined
from .skeletons import Skeleton

NO_TURN = np.array((1.0, 0.0, 0.0, 0.0))


class SeparateKeys(NamedTuple):
    """The separate keys of rotation and location of one joint, as returned by `reduce_skeleton_keys`.

    A channel with a single sample rests: it holds the value at that sample all the time.

    See Also
    --------
    reduce_skeleton_keys : Finds these keys, with `separate=True`.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, reduce_skeleton_keys
    >>> turn = np.linspace(0, np.pi / 2, 30)
    >>> quaternions = np.stack((np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)), axis=1)
    >>> poses = Poses(np.zeros((1, 30, 3)), quaternions[None])
    >>> (keys,) = reduce_skeleton_keys(np.arange(30) / 30, poses, [-1], "lerp_slerp", tolerance=0.002, separate=True)
    >>> keys.rotation.tolist(), keys.location.tolist()
    ([0, 29], [0])
    """

    rotation: np.ndarray
    """The samples with rotation keys, rising, shape (r,)."""

    location: np.ndarray
    """The samples with location keys, rising, shape (l,)."""


class Channels:
    """A body in which every joint with both a changing rotation and a changing location is split into two nodes.

    Parameters
    ----------
    whole : Body
    turns, moves : array of bool, shape (joints,), optional
        Which rotations and locations change, if that is known from a longer recording. The default: those in `whole`.
    """

    def __init__(self, whole: Body, turns: np.ndarray | None = None, moves: np.ndarray | None = None) -> None:
        poses = whole.poses
        self.whole = whole
        self.turns = changes(poses.quaternions) if turns is None else turns
        self.moves = changes(poses.positions) if moves is None else moves
        self.apart = np.flatnonzero(self.turns & self.moves & whole.free)
        """The split joints: the node with a joint's number turns, and the translating nodes come after all joints."""

    def budget(self, budget: int) -> int:
        """Convert a key budget of channels to one of nodes. Raise a ValueError if it is too small for all channels."""
        free, apart = int(np.count_nonzero(self.whole.free)), len(self.apart)
        moving = np.count_nonzero(self.turns & self.whole.free) + np.count_nonzero(self.moves & self.whole.free)
        if budget < 2 * free + moving:
            raise ValueError(
                f"a budget of {budget} keys is too small for {moving} rotations and locations that may need 2 each, "
                f"and {2 * free - moving} that never change and have 1"
            )
        return budget - (free - apart)

    @cached_property
    def body(self) -> Body:
        """The body with nodes in place of joints."""
        whole, apart = self.whole, self.apart
        if not len(apart):
            return whole
        poses, more = whole.poses, (len(apart), len(whole.times))
        scales = None if poses.scales is None else np.ones(more)
        nodes = joined((poses, Poses(poses.positions[apart], np.broadcast_to(NO_TURN, (*more, 4)), scales)))
        nodes.positions[apart] = 0.0
        parents = np.concatenate((whole.skeleton.parents, whole.skeleton.parents[apart]))
        parents[apart] = len(poses) + np.arange(len(apart))
        radii, free = np.append(whole.radii, np.zeros(len(apart))), np.append(whole.free, np.ones(len(apart), bool))
        weights = np.concatenate((whole.weights, np.zeros(more)))
        return Body(whole.times, nodes, Skeleton(parents), whole.mode, radii, weights, free, self._truth())

    def _truth(self) -> Poses:
        """Return the true poses of nodes in the root's space: translating nodes have the positions of their joints."""
        truth, above = self.whole.truth, self.whole.skeleton.parents[self.apart]
        more = truth[self.apart]
        scales = None if truth.scales is None else np.where((above >= 0)[:, None], truth.scales[above], 1.0)
        return joined((truth, Poses(more.positions, more.quaternions, scales)))

    def of_nodes(self, keys: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Return the keys of all nodes from the keys of joints."""
        return (*keys, *(keys[joint] for joint in self.apart.tolist()))

    def of_joints(self, keys: tuple[np.ndarray, ...]) -> tuple[SeparateKeys, ...]:
        """Return the keys of both channels of each joint from the keys of nodes."""
        rotations = list(keys[: len(self.whole.skeleton)])
        locations = list(rotations)
        for node, joint in enumerate(self.apart.tolist(), len(rotations)):
            locations[joint] = keys[node]
        first = np.zeros(1, dtype=np.int64)
        return tuple(
            SeparateKeys(rotation if turns else first, location if moves else first)
            for rotation, location, turns, moves in zip(rotations, locations, self.turns, self.moves, strict=True)
        )


def changes(rows: np.ndarray) -> np.ndarray:
    """Return which joints have numbers (joints, n, ...) that change between samples, shape (joints,)."""
    return (rows != rows[:, :1]).reshape(len(rows), -1).any(axis=1)


def check_separable(mode: str, poses: Poses) -> None:
    """Raise a ValueError if the mode does not allow separate keys, or if scales of poses (joints, n) change."""
    if not MODES[mode].is_separable:
        names = ", ".join(name for name, row in MODES.items() if row.is_separable)
        raise ValueError(
            f"separate=True needs a mode whose rotation and location do not depend on one another, {names}, and {mode} "
            "is none"
        )
    if poses.scales is not None and (grows := changes(poses.scales)).any():
        raise ValueError(
            f"the scale of joint {int(np.argmax(grows))} changes, and separate=True has keys of rotation and location "
            "alone: leave it out, for keys of whole poses"
        )
