"""Recordings of whole bodies: joints that hang on one another, and how far off they are in the root's space."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from .checks import check_body
from .measures import shell_error
from .modes import interpolate
from .poses import PackedPoses, Poses
from .quaternions import normalise
from .skeletons import Skeleton

SOME_TURN = 1e-12
"""What a mean of quaternions is turned by, so that it has a length."""


class Body:
    """The recording of a body, and what it is measured by. Errors are weighted."""

    def __init__(
        self,
        times: np.ndarray,
        poses: Poses,
        skeleton: Skeleton,
        mode: str,
        radii: np.ndarray,
        weights: np.ndarray,
        free: np.ndarray,
    ) -> None:
        self.times, self.poses, self.skeleton, self.mode = times, poses, skeleton, mode
        self.radii, self.weights, self.free = radii, weights, free
        with np.errstate(over="ignore", invalid="ignore"):
            self.truth = skeleton.in_root_space(poses)
        check_body(times, self.truth, ", in the root's space")

    def errors(self, shown: Poses, samples: np.ndarray | None = None) -> np.ndarray:
        """Of all joints (joints, m), where these poses (joints, m) in their parents' space are shown, at samples."""
        there = self.skeleton.in_root_space(shown)
        if samples is None:
            return shell_error(there, self.truth, self.radii[:, None]) * self.weights
        return shell_error(there, self.packed_truth[samples], self.radii[:, None]) * self.weights[:, samples]

    @cached_property
    def packed_truth(self) -> PackedPoses:
        return PackedPoses(self.truth)

    def shown(self, joint: int, keys: np.ndarray) -> Poses:
        """What a joint does between keys (k,), shape (n,)."""
        return interpolate(self.times[keys], self.poses[joint][keys], self.times, self.mode)

    @cached_property
    def middles(self) -> np.ndarray:
        """The sample of each joint that is nearest to its mean pose, shape (joints,)."""
        scales = self.poses.scales
        means = Poses(
            self.poses.positions.mean(axis=1, keepdims=True),
            normalise(self.poses.quaternions.mean(axis=1, keepdims=True) + SOME_TURN),
            None if scales is None else scales.mean(axis=1, keepdims=True),
        )
        return np.argmin(shell_error(self.poses, _spread(means, self.poses), self.sizes), axis=1)

    def at_rest(self) -> Poses:
        """Every joint in its middle pose all the time, shape (joints, n)."""
        joints = np.arange(len(self.skeleton))
        return _spread(self.poses[joints[:, None], self.middles[:, None]], self.poses)

    @cached_property
    def sizes(self) -> np.ndarray:
        """How far everything that hangs on a joint is from it, with the balls around it, shape (joints, n)."""
        balls = np.broadcast_to(self.radii[:, None], self.poses.shape)
        balls = balls if self.truth.scales is None else balls * self.truth.scales
        found = balls.copy()
        for joint in np.flatnonzero(self.skeleton.sizes > 1).tolist():
            below = self.skeleton.below(joint)
            away = self.truth.positions[below] - self.truth.positions[joint]
            found[joint] = (np.sqrt(np.einsum("jni,jni->jn", away, away)) + balls[below]).max(axis=0)
        return found


def _spread(one: Poses, over: Poses) -> Poses:
    """Poses (joints, 1) for all moments of others (joints, n)."""
    return Poses(
        np.broadcast_to(one.positions, over.positions.shape),
        np.broadcast_to(one.quaternions, over.quaternions.shape),
        None if one.scales is None else np.broadcast_to(one.scales, over.scales.shape),
    )
