"""Skeletons: joints in their parents' space, and where that puts them.

Arrays of a skeleton have the joints first: poses of shape (joints, n). `parents` has the number of each joint's parent,
-1 for roots, in any order. The root's space is the one that the poses of roots are given in.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses
from .poses import PackedPoses, Poses, placed


class Skeleton:
    """Which joint hangs on which, and where that puts them.

    Parameters
    ----------
    parents : array-like of int, shape (joints,)
        The number of each joint's parent, -1 for roots, in any order.

    Raises
    ------
    ValueError
        Where a parent is no joint, or joints hang on one another in a circle. The message names the joint.

    See Also
    --------
    reduce_skeleton_keys : Few keys for all joints of a skeleton.

    Examples
    --------
    A hip, a knee below it, and a head that hangs on nothing:

    >>> from rigid_motion.motion import Poses, Skeleton
    >>> skeleton = Skeleton([-1, 0, -1])
    >>> skeleton, len(skeleton), skeleton.depths.tolist()
    (Skeleton([-1, 0, -1]), 3, [0, 1, 0])
    >>> poses = Poses([[[0, 0, 1]], [[0, 0, -0.5]], [[0, 0, 1.75]]], [[[1, 0, 0, 0]]] * 3)
    >>> skeleton.in_root_space(poses).positions[:, 0].tolist()
    [[0.0, 0.0, 1.0], [0.0, 0.0, 0.5], [0.0, 0.0, 1.75]]
    """

    def __init__(self, parents: ArrayLike) -> None:
        parents = np.asarray(parents)
        if parents.ndim != 1 or not (len(parents) and np.issubdtype(parents.dtype, np.integer)):
            raise ValueError("parents need to be whole numbers, one for each joint")
        wrong = (parents < -1) | (parents >= len(parents))
        if wrong.any():
            joint = int(np.argmax(wrong))
            raise ValueError(f"joint {joint} has the parent {parents[joint]}: there are joints 0 to {len(parents) - 1}")
        self.parents = parents.astype(np.int64)
        self.depths = self._depths()
        """How many joints each hangs on, shape (joints,)."""

    def __len__(self) -> int:
        return len(self.parents)

    def __repr__(self) -> str:
        return f"Skeleton({self.parents.tolist()})"

    def _depths(self) -> np.ndarray:
        depths, above = np.zeros(len(self.parents), dtype=np.int64), self.parents
        for _ in range(len(self.parents)):
            if np.all(above < 0):
                return depths
            depths += above >= 0
            above = np.where(above >= 0, self.parents[above], -1)
        # So far up there is nothing but the circle.
        raise ValueError(f"joint {int(above[above >= 0].min())} hangs on itself, through its parents")

    @cached_property
    def levels(self) -> list[np.ndarray]:
        """The joints of each depth, from the roots on. No two of a level hang on one another."""
        return [np.flatnonzero(self.depths == depth) for depth in range(self.depths.max() + 1)]

    @cached_property
    def below(self) -> list[np.ndarray]:
        """Of each joint, itself and all that hang on it, rising."""
        hangs = np.eye(len(self), dtype=bool)
        for joints in self.levels[:0:-1]:
            for joint in joints.tolist():
                hangs[self.parents[joint]] |= hangs[joint]
        return [np.flatnonzero(row) for row in hangs]

    def in_root_space(self, poses: Poses) -> Poses:
        """Where joints are that have these poses in their parents' space.

        Parameters
        ----------
        poses : Poses, shape (joints, ...)
            With unit quaternions.

        Returns
        -------
        Poses, shape (joints, ...)
            In the space that the poses of roots are given in.

        Raises
        ------
        TypeError
            Where they are no `Poses`.
        ValueError
            Where there are not as many as joints.
        """
        check_poses(poses, "poses")
        if poses.shape[:1] != (len(self),):
            raise ValueError(f"poses of shape {poses.shape} do not fit {len(self)} joints, which come first")
        there = PackedPoses(poses)
        for joints in self.levels[1:]:
            there.put(joints, placed(there.of(self.parents[joints]), there.of(joints)))
        return there.of(slice(None))
