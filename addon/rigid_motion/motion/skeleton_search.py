"""The search for separate keys of each joint of a body, or of each rotation and location of joints."""

from __future__ import annotations

import numpy as np

from .bodies import Body
from .key_costs import SampleTracks
from .key_search import KeySearch, KeySelection
from .poses import Poses, reshaped
from .skeleton_channels import Channels, changes
from .skeleton_levels import Level

ZERO_WEIGHT = 1e-30
"""Replaces a weight of zero in divisions."""


class OwnKeys:
    """The search for separate keys of each joint.

    First every joint on a chain gets a share of the tolerance, for the largest displacement that its own error causes
    at any joint below. By the triangle inequality, this is enough. As errors of joints seldom add up, keys are then
    removed as long as the error in the root's space allows it. This is done for all joints of a depth at once, as they
    do not move each other, with the joints above and below them as they are shown at that time.

    With `may_rest` a joint that need not move has a single key. Otherwise only joints that never move have one.
    """

    off_at_keys = False

    def __init__(self, body: Body, tolerance: float, may_rest: bool = True) -> None:
        self.body, self.tolerance, self.may_rest, self.shown = body, tolerance, may_rest, body.poses.copy()
        every = np.arange(len(body.times))
        self.keys = [body.middles[[joint]] if free else every for joint, free in enumerate(body.free.tolist())]

    def found(self) -> tuple[np.ndarray, ...]:
        self._select_within_shares()
        for joints in self.body.skeleton.levels:
            self._remove_keys(joints)
        self._enforce_tolerance()
        return tuple(self.keys)

    def spend(self, budget: int) -> None:
        """Add keys where the error is largest, one place after the other, as long as this makes the error smaller."""
        least = self.body.errors(self.shown).max()
        while True:
            errors = self.body.errors(self.shown)
            keys, shown = list(self.keys), self.shown.copy()
            self._add_keys(np.argmax(errors, keepdims=False)[None])
            count = sum(len(keys) for joint, keys in enumerate(self.keys) if self.body.free[joint])
            error = self.body.errors(self.shown).max()
            if count > budget or not error < least:
                self.keys, self.shown = keys, shown
                return
            least = error

    def _select_within_shares(self) -> None:
        """Find keys of all joints, each within its share of the tolerance."""
        body, count = self.body, len(self.body.times)
        sizes, shares = self._sizes_and_shares()
        rests = ~that_move(body.poses)
        if self.may_rest:
            rests = np.all(body.shell_errors(body.at_rest(), body.poses, sizes) <= shares, axis=1)
        self.shown[rests & body.free] = body.at_rest()[rests & body.free]
        moving = np.flatnonzero(~rests & body.free)
        if len(moving):
            times, starts = np.tile(body.times, len(moving)), count * np.arange(len(moving))
            size, share = sizes[moving].ravel(), shares[moving].ravel()
            search = KeySearch(SampleTracks(times, reshaped(body.poses[moving], -1), body.mode, size, share, starts))
            self._show_tracks(moving, search.thinned(search.measured(np.arange(len(times))), 1.0))

    def _sizes_and_shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the reach of everything below each joint, and the error that the joint may cause, both (joints, n).

        Both are in the unit of the joint's parent. Joints that never move need no share.
        """
        body, skeleton = self.body, self.body.skeleton
        longest_chains = skeleton.longest_chains((that_move(body.poses) & body.free).astype(np.int64))
        shares = (self.tolerance - skeleton.most_below(body.off)) / np.maximum(longest_chains, 1)[:, None]
        shares /= np.maximum(skeleton.most_below(body.weights), ZERO_WEIGHT)
        if body.truth.scales is None:
            return body.sizes, shares
        on_joints = (skeleton.parents >= 0)[:, None]
        return body.sizes / body.truth.scales, shares / np.where(on_joints, body.truth.scales[skeleton.parents], 1.0)

    def _show_tracks(self, joints: np.ndarray, keys: KeySelection) -> None:
        """Store and show the keys of joints that were searched as tracks."""
        count = len(self.body.times)
        bounds = np.searchsorted(keys.indices, count * np.arange(len(joints) + 1))
        for number, joint in enumerate(joints.tolist()):
            self._show(joint, keys.indices[bounds[number] : bounds[number + 1]] - count * number)

    def _show(self, joint: int, keys: np.ndarray) -> None:
        self.keys[joint] = keys
        self.shown[joint] = self.body.shown(joint, keys)

    def _remove_keys(self, joints: np.ndarray) -> None:
        """Remove keys of joints of one level, as far as the error in the root's space allows."""
        movable = [joint for joint in joints.tolist() if len(self.keys[joint]) > 1 and self.body.free[joint]]
        joints = np.array(movable, dtype=np.int64)
        if not len(joints):
            return
        level = self._level(joints)
        rests = level.may_rest() if self.may_rest else level.counts == 0
        for joint in joints[rests].tolist():
            self._show(joint, self.body.middles[[joint]] if self.may_rest else self._ends)
        joints = joints[~rests]
        if len(joints):
            count = len(self.body.times)
            search = KeySearch(self._level(joints) if rests.any() else level)
            tracks = [count * number + self.keys[joint] for number, joint in enumerate(joints.tolist())]
            self._show_tracks(joints, search.refined(search.thinned(search.measured(np.concatenate(tracks)), 1.0)))

    @property
    def _ends(self) -> np.ndarray:
        return np.array((0, len(self.body.times) - 1))

    def _level(self, joints: np.ndarray) -> Level:
        return Level(self.body, joints, self.shown, self.tolerance, self.off_at_keys)

    def _enforce_tolerance(self) -> None:
        """Add keys where errors still exceed the tolerance by more than rounding."""
        allowed, many = self.tolerance * (1.0 + 1e-9), 1
        while True:
            # If every joint rests, a single pose is enough.
            rests = all(len(keys) == 1 for keys in self.keys)
            errors = self.body.errors(self.body.at_rest() if rests else self.shown)
            errors[self._keyed()] = 0.0  # Errors left there are rounding, and may exceed a tiny tolerance.
            over = np.flatnonzero(errors > allowed)
            if not len(over):
                return
            worst = over[np.argsort(-errors.flat[over], kind="stable")[:many]]
            self._add_keys(worst)
            many *= 2

    def _keyed(self) -> np.ndarray:
        """Return at which samples a joint and all joints above it have keys, shape (joints, n)."""
        keyed = np.zeros(self.body.poses.shape, dtype=bool)
        for joint, keys in enumerate(self.keys):
            keyed[joint, keys] = True
        for joints in self.body.skeleton.levels[1:]:
            keyed[joints] &= keyed[self.body.skeleton.parents[joints]]
        return keyed

    def _add_keys(self, numbers: np.ndarray) -> None:
        """Add keys at these flat indices into (joints, n), also for the joints above."""
        desired = np.zeros(self.body.poses.shape, dtype=bool)
        desired.flat[numbers] = True
        desired = self.body.skeleton.most_below(desired)
        for joint in np.flatnonzero(desired.any(axis=1) & self.body.free).tolist():
            more = np.concatenate((self._ends, np.flatnonzero(desired[joint])))
            self._show(joint, np.union1d(self.keys[joint], more))


class ChannelKeys(OwnKeys):
    """The search for separate keys of rotations and locations: both begin with the joint's keys, and lose more of them.

    So there are never more keys than with `OwnKeys`. A channel may be wrong at the keys of the other channel, so errors
    at keys count too. Without this, the last step would add many keys again.
    """

    off_at_keys = True

    def __init__(self, channels: Channels, tolerance: float, may_rest: bool = True) -> None:
        super().__init__(channels.body, tolerance, may_rest)
        self.channels = channels

    def _select_within_shares(self) -> None:
        whole = OwnKeys(self.channels.whole, self.tolerance, self.may_rest).found()
        for node, keys in enumerate(self.channels.of_nodes(whole)):
            self._show(node, keys)


def that_move(poses: Poses) -> np.ndarray:
    """Return which joints, from poses (joints, n), ever move in their parents' space, shape (joints,)."""
    numbers = [poses.positions, poses.quaternions] + ([] if poses.scales is None else [poses.scales])
    return np.any([changes(rows) for rows in numbers], axis=0)
