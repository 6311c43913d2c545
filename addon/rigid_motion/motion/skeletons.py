"""Skeletons: hierarchies of joints, and their poses in the root's space.

Arrays of a skeleton have the joints first: poses of shape (joints, n). `parents` has the number of each joint's parent,
-1 for roots, in any order. The root's space is the space in which the poses of roots are given.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses
from .poses import Poses, packed, placed
from .quaternions import rotate

AT_ONCE = 2**15
"""Poses processed at once, to fit the processor's caches."""

MAX_MATRIX_POSES = 64
"""The most poses of each joint for which matrix products are faster."""

_LEFT_PRODUCT_COMPONENTS = np.array(((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)))
_LEFT_SIGNS = np.array(((1, -1, -1, -1), (1, 1, -1, 1), (1, 1, 1, -1), (1, -1, 1, 1)))
"""Components and signs that write a quaternion q as a matrix, such that matrix(p) @ matrix(q) is matrix(p q)."""


class Skeleton:
    """A hierarchy of joints, which converts their poses to the root's space.

    Parameters
    ----------
    parents : array-like of int, shape (joints,)
        The number of each joint's parent, -1 for roots, in any order.

    Raises
    ------
    ValueError
        If a parent is not a joint, or parents form a cycle. The message names the joint.

    See Also
    --------
    reduce_skeleton_keys : Few keys for all joints of a skeleton.

    Examples
    --------
    A hip, a knee below it, and a head without a parent:

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
        """The number of joints above each joint, shape (joints,)."""

    def __len__(self) -> int:
        return len(self.parents)

    def __repr__(self) -> str:
        return f"Skeleton({self.parents.tolist()})"

    def _depths(self) -> np.ndarray:
        depths, above = (self.parents >= 0).astype(np.int64), self.parents
        for _ in range(len(self.parents).bit_length()):
            if np.all(above < 0):
                return depths
            # Twice as far up in every step.
            depths += np.where(above >= 0, depths[above], 0)
            above = np.where(above >= 0, above[above], -1)
        if np.all(above < 0):
            return depths
        # Only joints of a cycle are left this far up.
        raise ValueError(f"joint {np.min(above[above >= 0])} hangs on itself, through its parents")

    @cached_property
    def levels(self) -> list[np.ndarray]:
        """The joints of each depth, beginning with the roots. No joint of a level is below another one."""
        order = np.argsort(self.depths, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.depths))[:-1])

    @cached_property
    def sizes(self) -> np.ndarray:
        """The number of joints below each joint, including itself, shape (joints,)."""
        sizes = np.ones(len(self), dtype=np.int64)
        for joints in self.levels[:0:-1]:
            np.add.at(sizes, self.parents[joints], sizes[joints])
        return sizes

    @cached_property
    def _depth_first(self) -> tuple[np.ndarray, np.ndarray]:
        """The rank of each joint in depth-first order, and the joints in this order, both (joints,)."""
        first, order = np.zeros(len(self), dtype=np.int64), np.empty(len(self), dtype=np.int64)
        for joints in self.levels:
            parents = self.parents[joints]
            joints = joints[np.argsort(parents, kind="stable")]
            parents, sizes = self.parents[joints], self.sizes[joints]
            before = np.cumsum(sizes) - sizes
            siblings = np.searchsorted(parents, parents)
            first[joints] = before - before[siblings] + np.where(parents >= 0, first[parents] + 1, 0)
        order[first] = np.arange(len(self))
        return first, order

    def below(self, joint: int) -> np.ndarray:
        """Return a joint and all joints below it, rising, shape (sizes[joint],)."""
        first, order = self._depth_first
        return np.sort(order[first[joint] : first[joint] + self.sizes[joint]])

    def longest_chains(self, counts: np.ndarray) -> np.ndarray:
        """Return the largest sum of counts (joints,) along any chain from a root to a leaf through each joint."""
        above, beneath = counts.copy(), counts.copy()
        for joints in self.levels[1:]:
            above[joints] += above[self.parents[joints]]
        for joints in self.levels[:0:-1]:
            parents = self.parents[joints]
            np.maximum.at(beneath, parents, counts[parents] + beneath[joints])
        return above + beneath - counts

    def most_below(self, numbers: np.ndarray) -> np.ndarray:
        """Return the largest of the numbers (joints, ...) among each joint and all joints below it."""
        most = numbers.copy()
        for joints in self.levels[:0:-1]:
            np.maximum.at(most, self.parents[joints], most[joints])
        return most

    def in_root_space(self, poses: Poses) -> Poses:
        """Return the poses in the root's space of joints with these poses in their parents' space.

        Parameters
        ----------
        poses : Poses, shape (joints, ...)
            With unit quaternions.

        Returns
        -------
        Poses, shape (joints, ...)
            In the space in which the poses of roots are given.

        Raises
        ------
        TypeError
            If the argument is not a `Poses`.
        ValueError
            If its first axis does not have one entry for each joint.
        """
        check_poses(poses, "poses")
        if poses.shape[:1] != (len(self),):
            raise ValueError(f"poses of shape {poses.shape} do not fit {len(self)} joints, which come first")
        if poses.scales is None and poses.quaternions[0].size <= 4 * MAX_MATRIX_POSES:
            return self._few_in_root_space(poses)
        there = packed(poses)
        for part in there.blocks(AT_ONCE):
            for joints in self.levels[1:]:
                part.put(joints, placed(part.of(self.parents[joints]), part.of(joints)))
        return there.of(slice(None))

    def _few_in_root_space(self, poses: Poses) -> Poses:
        turns = poses.quaternions[..., _LEFT_PRODUCT_COMPONENTS] * _LEFT_SIGNS
        for joints in self.levels[1:]:
            # Equal poses stay equal to the last bit, which the operator @ does not guarantee.
            turns[joints] = np.einsum("...ij,...jk->...ik", turns[self.parents[joints]], turns[joints])
        quaternions = turns[..., 0]
        arms = rotate(quaternions[self.parents], poses.positions)
        hanging = (self.parents >= 0).reshape(-1, *(1,) * (arms.ndim - 1))
        positions = np.where(hanging, arms, poses.positions)
        for joints in self.levels[1:]:
            positions[joints] += positions[self.parents[joints]]
        return Poses(positions, quaternions)
