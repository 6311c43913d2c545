"""The search for keys that joints of a body have of their own, and for those of their channels."""

from __future__ import annotations

import numpy as np

from .bodies import Body
from .key_costs import SampleTracks
from .key_search import KeySearch, KeySelection
from .poses import Poses, reshaped
from .skeleton_channels import Channels, changes
from .skeleton_levels import Level

ZERO_WEIGHT = 1e-30
"""Stands for a weight of zero."""


class OwnKeys:
    """The search for keys that each joint has of its own.

    First every joint on a chain gets its share of the tolerance, for the largest displacement that its own error gives
    to anything that hangs on it: by the triangle inequality that is enough. Errors of joints seldom add up, though, so
    then keys are taken out for as long as the error in the root's space allows it: of all joints of a depth at once,
    since these do not move one another, with what hangs on them and what they hang on as it is shown by then.

    With `may_rest` a joint that need not move has a single key. Otherwise only those that never do have one.
    """

    off_at_keys = False

    def __init__(self, body: Body, tolerance: float, may_rest: bool = True) -> None:
        self.body, self.tolerance, self.may_rest, self.shown = body, tolerance, may_rest, body.poses.copy()
        every = np.arange(len(body.times))
        self.keys = [body.middles[[joint]] if free else every for joint, free in enumerate(body.free.tolist())]

    def found(self) -> tuple[np.ndarray, ...]:
        self._share_out()
        for joints in self.body.skeleton.levels:
            self._take_out(joints)
        self._prove()
        return tuple(self.keys)

    def spend(self, budget: int) -> None:
        """Put keys in where errors are largest, one place after the other, as long as that makes them smaller."""
        least = self.body.errors(self.shown).max()
        while True:
            errors = self.body.errors(self.shown)
            keys, shown = list(self.keys), self.shown.copy()
            self._put_back(np.argmax(errors, keepdims=False)[None])
            count = sum(len(keys) for joint, keys in enumerate(self.keys) if self.body.free[joint])
            error = self.body.errors(self.shown).max()
            if count > budget or not error < least:
                self.keys, self.shown = keys, shown
                return
            least = error

    def _share_out(self) -> None:
        """Keys of all joints, each within its share of the tolerance."""
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
            self._take(moving, search.thinned(search.measured(np.arange(len(times))), 1.0))

    def _sizes_and_shares(self) -> tuple[np.ndarray, np.ndarray]:
        """How large what hangs on each joint is and how far it may be off by that joint, both (joints, n).

        Both in the unit of the joint's parent. Joints that never move need no share.
        """
        body, skeleton = self.body, self.body.skeleton
        longest_chains = skeleton.longest_chains((that_move(body.poses) & body.free).astype(np.int64))
        shares = (self.tolerance - skeleton.most_below(body.off)) / np.maximum(longest_chains, 1)[:, None]
        shares /= np.maximum(skeleton.most_below(body.weights), ZERO_WEIGHT)
        if body.truth.scales is None:
            return body.sizes, shares
        on_joints = (skeleton.parents >= 0)[:, None]
        return body.sizes / body.truth.scales, shares / np.where(on_joints, body.truth.scales[skeleton.parents], 1.0)

    def _take(self, joints: np.ndarray, keys: KeySelection) -> None:
        """Note and show the keys of joints that were tracks."""
        count = len(self.body.times)
        bounds = np.searchsorted(keys.indices, count * np.arange(len(joints) + 1))
        for number, joint in enumerate(joints.tolist()):
            self._show(joint, keys.indices[bounds[number] : bounds[number + 1]] - count * number)

    def _show(self, joint: int, keys: np.ndarray) -> None:
        self.keys[joint] = keys
        self.shown[joint] = self.body.shown(joint, keys)

    def _take_out(self, joints: np.ndarray) -> None:
        """Take keys out of joints that do not hang on one another, as far as the error in the root's space allows."""
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
            self._take(joints, search.refined(search.thinned(search.measured(np.concatenate(tracks)), 1.0)))

    @property
    def _ends(self) -> np.ndarray:
        return np.array((0, len(self.body.times) - 1))

    def _level(self, joints: np.ndarray) -> Level:
        return Level(self.body, joints, self.shown, self.tolerance, self.off_at_keys)

    def _prove(self) -> None:
        """Put keys back where errors are over the tolerance after all, which takes more than rounding to happen."""
        allowed, many = self.tolerance * (1.0 + 1e-9), 1
        while True:
            # What rests all over is in one place.
            rests = all(len(keys) == 1 for keys in self.keys)
            errors = self.body.errors(self.body.at_rest() if rests else self.shown)
            errors[self._keyed()] = 0.0  # Whatever is left there is rounding, and may be more than a tiny tolerance.
            over = np.flatnonzero(errors > allowed)
            if not len(over):
                return
            worst = over[np.argsort(-errors.flat[over], kind="stable")[:many]]
            self._put_back(worst)
            many *= 2

    def _keyed(self) -> np.ndarray:
        """Where joints and all that they hang on have keys, shape (joints, n)."""
        keyed = np.zeros(self.body.poses.shape, dtype=bool)
        for joint, keys in enumerate(self.keys):
            keyed[joint, keys] = True
        for joints in self.body.skeleton.levels[1:]:
            keyed[joints] &= keyed[self.body.skeleton.parents[joints]]
        return keyed

    def _put_back(self, numbers: np.ndarray) -> None:
        """Keys at these of all joints' samples (joints * n,), also for what the joints hang on."""
        desired = np.zeros(self.body.poses.shape, dtype=bool)
        desired.flat[numbers] = True
        desired = self.body.skeleton.most_below(desired)
        for joint in np.flatnonzero(desired.any(axis=1) & self.body.free).tolist():
            more = np.concatenate((self._ends, np.flatnonzero(desired[joint])))
            self._show(joint, np.union1d(self.keys[joint], more))


class ChannelKeys(OwnKeys):
    """The same for rotations and locations: from the keys of joints, which both begin with, more are taken out.

    So there are never more of them. As one channel's keys go the other's stay, and what is off at them by the other
    counts: without that, the proof would put many back.
    """

    off_at_keys = True

    def __init__(self, channels: Channels, tolerance: float, may_rest: bool = True) -> None:
        super().__init__(channels.body, tolerance, may_rest)
        self.channels = channels

    def _share_out(self) -> None:
        whole = OwnKeys(self.channels.whole, self.tolerance, self.may_rest).found()
        for node, keys in enumerate(self.channels.of_nodes(whole)):
            self._show(node, keys)


def that_move(poses: Poses) -> np.ndarray:
    """Which joints (joints, n) ever change in their parents' space, shape (joints,)."""
    numbers = [poses.positions, poses.quaternions] + ([] if poses.scales is None else [poses.scales])
    return np.any([changes(rows) for rows in numbers], axis=0)
