"""Joints whose rotation and location have keys of their own: two joints stand for one, in modes that allow it.

A node that only translates has a node below it that only turns, and all that hangs on the joint hangs on that one. This
is the same motion wherever neither channel depends on the other between keys, so that the search for keys of bodies
finds those of channels. A joint with a channel that never changes stays a single node, and so does one that is fixed.
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
    """The keys of one joint whose rotation and location are thinned apart, as `reduce_skeleton_keys` finds them.

    A channel with a single sample rests: it holds what it has at that sample all the time.

    See Also
    --------
    reduce_skeleton_keys : What finds them, with `separate=True`.

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
    """Rising samples, shape (r,)."""

    location: np.ndarray
    """Rising samples, shape (l,)."""


class Channels:
    """A body whose joints are taken apart where both channels of one change.

    Parameters
    ----------
    whole : Body
    turns, moves : array of bool, shape (joints,), optional
        Which rotations and which locations change, where that is known of more than what is here.
    """

    def __init__(self, whole: Body, turns: np.ndarray | None = None, moves: np.ndarray | None = None) -> None:
        poses = whole.poses
        self.whole = whole
        self.turns = changes(poses.quaternions) if turns is None else turns
        self.moves = changes(poses.positions) if moves is None else moves
        self.apart = np.flatnonzero(self.turns & self.moves & whole.free)
        """The joints that two nodes stand for: a joint's own number turns, and the others come behind all joints."""

    def budget(self, budget: int) -> int:
        """Return what a budget of keys leaves for nodes, or a ValueError where that is too little for what may move."""
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
        """The nodes as a body."""
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
        """Where nodes should be in the root's space: those that only translate are where their joints are."""
        truth, above = self.whole.truth, self.whole.skeleton.parents[self.apart]
        more = truth[self.apart]
        scales = None if truth.scales is None else np.where((above >= 0)[:, None], truth.scales[above], 1.0)
        return joined((truth, Poses(more.positions, more.quaternions, scales)))

    def of_nodes(self, keys: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Return the keys of joints as those of nodes."""
        return (*keys, *(keys[joint] for joint in self.apart.tolist()))

    def of_joints(self, keys: tuple[np.ndarray, ...]) -> tuple[SeparateKeys, ...]:
        """Return the keys of nodes as those of channels."""
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
    """Which joints have anything but the same numbers at all samples, from (joints, n, ...), shape (joints,)."""
    return (rows != rows[:, :1]).reshape(len(rows), -1).any(axis=1)


def check_separable(mode: str, poses: Poses) -> None:
    """Raise a ValueError where channels of joints (joints, n) cannot have keys of their own, or are more than two."""
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
