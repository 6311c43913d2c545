"""Recordings of whole bodies: joints in a hierarchy, and their errors in root space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .checks import check_body
from .measures import shell_error
from .modes import interpolate
from .poses import PackedPoses, Poses, of_each, packed
from .quaternions import components, normalise
from .skeletons import AT_ONCE, Skeleton

SOME_TURN = 1e-12
"""Added to means of quaternions, so that none has length zero."""


@dataclass(frozen=True, eq=False)
class Body:
    """The recording of a body and how its errors are measured. Errors are weighted."""

    times: np.ndarray
    poses: Poses
    skeleton: Skeleton
    mode: str
    radii: np.ndarray
    weights: np.ndarray
    free: np.ndarray
    desired: Poses | None = None
    """Where joints should be in root space, if not where `poses` put them."""

    @cached_property
    def truth(self) -> Poses:
        if self.desired is not None:
            return self.desired
        with np.errstate(over="ignore", invalid="ignore"):
            truth = self.skeleton.in_root_space(self.poses)
        check_body(self.times, truth, ", in the root's space")
        return truth

    def errors(self, shown: Poses, samples: np.ndarray | None = None) -> np.ndarray:
        """Return the errors of all joints (joints, m) for poses (joints, m) in parent space, at all samples or at
        these.
        """
        there = self.skeleton.in_root_space(shown)
        if samples is None:
            return self.shell_errors(there, self.truth, self.radii[:, None]) * self.weights
        return shell_error(there, self.packed_truth[samples], self.radii[:, None]) * self.weights[:, samples]

    def shell_errors(self, shown: Poses, truth: Poses, sizes: np.ndarray) -> np.ndarray:
        """Return shell errors (joints, n) of poses for balls of some sizes; both may be (joints, 1) or (joints, n)."""
        result = np.empty(truth.shape)
        for some in self._blocks:
            balls = sizes if sizes.shape[1] == 1 else sizes[:, some]
            result[:, some] = shell_error(shown if shown.shape[1] == 1 else shown[:, some], truth[:, some], balls)
        return result

    @cached_property
    def _blocks(self) -> list[slice]:
        """Slices of samples that are processed at a time."""
        step = max(1, AT_ONCE // len(self.skeleton))
        return [slice(first, first + step) for first in range(0, len(self.times), step)]

    @cached_property
    def off(self) -> np.ndarray:
        """Errors of the recorded poses themselves, shape (joints, n): zero unless `desired` is given."""
        return self.errors(self.poses)

    @cached_property
    def packed_truth(self) -> PackedPoses:
        return packed(self.truth)

    def shown(self, joint: int, keys: np.ndarray) -> Poses:
        """Return the motion of a joint between keys (k,), shape (n,)."""
        return interpolate(self.times[keys], self.poses[joint][keys], self.times, self.mode)

    @cached_property
    def middles(self) -> np.ndarray:
        """The sample of each joint that is nearest to its mean pose, shape (joints,)."""
        means = of_each(self.poses, lambda rows: rows.mean(axis=1, keepdims=True))
        means = Poses(means.positions, normalise(means.quaternions + SOME_TURN), means.scales)
        return np.argmin(self.shell_errors(means, self.poses, self.sizes), axis=1)

    def at_rest(self) -> Poses:
        """Return each joint's middle pose, shape (joints, 1)."""
        joints = np.arange(len(self.skeleton))
        return self.poses[joints[:, None], self.middles[:, None]]

    @cached_property
    def sizes(self) -> np.ndarray:
        """How far the balls of a joint and of all joints below it reach from the joint, shape (joints, n)."""
        balls = np.broadcast_to(self.radii[:, None], self.poses.shape)
        balls = balls if self.truth.scales is None else balls * self.truth.scales
        result = balls.copy()
        with_more = [(joint, self.skeleton.below(joint)) for joint in np.flatnonzero(self.skeleton.sizes > 1).tolist()]
        for some in self._blocks:
            positions = components(self.truth.positions[:, some])
            for joint, below in with_more:
                away = positions[:, below] - positions[:, [joint]]
                away *= away
                reached = np.sqrt(away[0] + away[1] + away[2]) + balls[below, some]
                result[joint, some] = reached.max(axis=0)
        return result
