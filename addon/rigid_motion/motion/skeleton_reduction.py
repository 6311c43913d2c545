"""Key reduction of whole bodies: few keys for joints that hang on one another.

What counts is where everything gets: an error of a joint moves all that hangs on it. The error is therefore looked at
in the root's space, through the hierarchy, at every joint and sample. Joints have keys of their own, or all of them
share *key poses*, as animators work from pose to pose.

Source: the error in the space of the whole object is that of the Animation Compression Library; key poses that bodies
share are those of Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .bodies import Body
from .checks import check_body, check_flag, check_poses, check_wishes
from .key_budget import BudgetSearch
from .key_costs import Recording
from .key_search import Keys, Search
from .modes import mode_named
from .poses import LIMIT, PackedPoses, Poses, numbers, reshaped
from .quaternions import align_signs
from .skeleton_channels import Channels, SeparateKeys, changes
from .skeleton_levels import Level
from .skeletons import Skeleton

TINY = 1e-30
"""Stands for a weight of zero."""

BUDGET_STEPS = 9
"""Of a search for the tolerance that a budget of keys of their own can keep to."""

FARTHEST = 1.5
"""How far the next tolerance is from one that needs too few keys, by its logarithm."""

NARROW = 0.01
"""By how much of it the tolerance is known in the end."""

DEEPEST = 1000
"""How many joints a joint with keys of its own may hang on: the work grows with the square of it."""

LEAST = 12.0
"""How much smaller than that of a body at rest the tolerance may be, by its logarithm."""


def reduce_skeleton_keys(
    times: ArrayLike,
    poses: Poses,
    parents: ArrayLike,
    mode: str = "motor_spline",
    *,
    tolerance: float | None = None,
    radius: float | ArrayLike = 0.03,
    shared: bool = False,
    separate: bool = False,
    budget: int | None = None,
    weights: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
    tries: int = 2,
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """The fewest keys of a body's joints that keep every joint within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (joints, n)
        The recording: each joint in its parent's space, with unit quaternions.
    parents : array-like of int, shape (joints,)
        The number of each joint's parent, -1 for roots.
    mode : str
        What fills in between keys, a name in `MODES`.
    tolerance : float, optional
        The largest shell error of any joint at any sample, in the root's space and in the unit of the positions.
    radius : float or array-like, shape (joints,)
        Of the ball at each joint that the shell error is of, in the unit of the positions.
    shared : bool
        Key poses: all joints have keys at the same samples. Otherwise each has its own, the fewest in all.
    separate : bool
        Each joint's rotation and its location have keys of their own, for modes where neither depends on the other, as
        in `lerp_slerp`, and for joints whose scale does not change. There are never more numbers in them, at 4 to a
        rotation and 3 to a location, than in the keys of joints, mostly a fifth to two fifths fewer.
    budget : int, optional
        The most keys, instead of a tolerance: key poses, at least 2, or keys of all joints together, at least 2 for
        each. With `separate` keys of rotations and of locations count, at least 2 for each, and 1 where it never
        changes. The error is then as small as can be found: for key poses as `reduce_keys` does, for keys of their own
        by bisecting the tolerance, which takes the time of ten searches or so.
    weights : array-like, shape (joints,) or (joints, n), optional
        How many times the error of each joint counts, at each sample: more for feet that stand (see `standing`) and
        hands that hold, 0 for joints that do not matter. With a tolerance, a joint of weight 2 keeps to half of it.
    fixed : array-like of bool, shape (joints,), optional
        Joints that stay as they are recorded: they are carried along, and what hangs on them is measured.
    tries : int
        With `shared`, as in `reduce_keys`.

    Returns
    -------
    tuple of array of int, one for each joint
        Rising samples. A joint that need not move has a single one, whose pose it holds; the others have the first and
        the last among them, and all samples where they are fixed. With `separate`, a tuple of `SeparateKeys`, and the
        same holds for rotations and locations; what never changes in the recording has the first sample alone.

    Raises
    ------
    TypeError
        Where the recording is no `Poses`.
    ValueError
        As `reduce_keys` does, and where joints hang on one another in a circle, or without `shared` in chains of more
        than 1000, or radii or weights make no sense. The message names the joint.

    See Also
    --------
    reduce_keys : The same for one object.
    SeparateKeys : What there is of each joint with `separate`.
    standing : Which joints stand on the ground, for weights.

    Notes
    -----
    The error in the space of the whole object is that of the Animation Compression Library; key poses that bodies share
    are those of Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019.

    Examples
    --------
    An elbow that turns evenly about its z axis, on a shoulder that stays where it is:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, reduce_skeleton_keys
    >>> turn = np.linspace(0, np.pi / 2, 30)
    >>> positions = np.tile([[[0, 0, 1.4]], [[0.3, 0, 0]]], (1, 30, 1))
    >>> elbow = np.stack((np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)), axis=1)
    >>> poses = Poses(positions, [np.tile([1, 0, 0, 0], (30, 1)), elbow])
    >>> keys = reduce_skeleton_keys(np.arange(30) / 30, poses, [-1, 0], "dq_sclerp", tolerance=0.002)
    >>> [samples.tolist() for samples in keys]
    [[0], [0, 29]]
    """
    mode_named(mode)
    check_wishes(tolerance, budget, tries)
    check_flag(shared, "shared")
    check_flag(separate, "separate")
    if shared and separate:
        raise ValueError("key poses are whole poses: give one of shared=True and separate=True, not both")
    check_poses(poses, "poses")
    skeleton, times = Skeleton(parents), numbers(times, "times")
    if poses.shape != (len(skeleton), *times.shape):
        raise ValueError(f"poses of shape {poses.shape} do not fit {len(skeleton)} joints and {times.size} times")
    check_body(times, poses)
    radii = _one_for_each(radius, "radius", (len(skeleton),))
    weights = _one_for_each(1.0 if weights is None else weights, "weight", (len(skeleton),), poses.shape)
    if not np.any(weights > 0.0):
        raise ValueError("every joint has a weight of 0: nothing would matter")
    weights = np.broadcast_to(weights if weights.ndim == 2 else weights[:, None], poses.shape)
    free = ~_mask(fixed, len(skeleton))
    poses = Poses(poses.positions, align_signs(poses.quaternions), poses.scales)
    body = Body(times, poses, skeleton, mode, radii, weights, free)
    channels = Channels(body) if separate else None
    if budget is not None and channels:
        budget = channels.budget(budget)
    elif budget is not None and not shared and budget < 2 * np.count_nonzero(free):
        raise ValueError(f"a budget of {budget} keys is too small for {np.count_nonzero(free)} joints: each may need 2")
    if len(times) <= 1:
        keys = (np.arange(len(times)),) * len(skeleton)
        return tuple(SeparateKeys(own, own) for own in keys) if separate else keys
    if not shared and skeleton.depths.max() > DEEPEST:
        joint = int(skeleton.depths.argmax())
        raise ValueError(
            f"joint {joint} hangs on {skeleton.depths[joint]} others, and keys of their own are searched for where it "
            f"is {DEEPEST} at most: shared=True finds key poses for longer chains"
        )
    if shared:
        keys = _key_poses(body, tolerance, budget, tries)
        every = np.arange(len(times))
        return tuple(keys if moves else every for moves in free.tolist())
    search = functools.partial(_OwnKeys, body) if channels is None else functools.partial(_ChannelKeys, channels)
    keys = search(tolerance).found() if tolerance is not None else _own_keys_within(search, budget)
    return keys if channels is None else channels.of_joints(keys)


def _key_poses(body: Body, tolerance: float | None, budget: int | None, tries: int) -> np.ndarray:
    if len(body.times) <= 2:
        return np.arange(len(body.times))
    recording = _WholeBody(body, tolerance or 1.0)
    return Search(recording).within(tries) if tolerance is not None else BudgetSearch(recording, budget).least(tries)


def _own_keys_within(search_for: Callable[[float], _OwnKeys], budget: int) -> tuple[np.ndarray, ...]:
    """The keys with the smallest error among those of several tolerances that so many can keep to, and what is left."""
    best = search_for(math.inf)
    body = best.body
    free = np.flatnonzero(body.free).tolist()
    least = float(body.errors(body.at_rest()).max())
    # The logarithms of tolerances that need more and that need no more keys, and how many by their logarithm.
    low, high = None, (math.log(max(least, TINY)), math.log(len(free) or 1))
    lowest = high[0] - LEAST
    for _ in range(BUDGET_STEPS):
        logarithm = _between(low, high, math.log(budget))
        if logarithm < lowest or (low and high[0] - low[0] < NARROW):
            break
        search = search_for(math.exp(logarithm))
        count = sum(len(keys) for joint, keys in enumerate(search.found()) if body.free[joint])
        if count > budget:
            low = logarithm, math.log(count)
            continue
        high, error = (logarithm, math.log(count)), float(body.errors(search.shown).max())
        if error <= least:
            best, least = search, error
    best.spend(budget)
    return tuple(best.keys)


def _between(low: tuple[float, float] | None, high: tuple[float, float], count: float) -> float:
    """The logarithm of the tolerance to try next for the logarithm of a count of keys.

    It is where a straight line between a tolerance that is too low and one that is not has it, and never near its ends:
    counts are no smooth function of tolerances.
    """
    if low is None:
        return high[0] - FARTHEST
    share = (count - high[1]) / (low[1] - high[1]) if low[1] > high[1] else 0.5
    return high[0] + min(max(share, 0.25), 0.75) * (low[0] - high[0])


class _WholeBody(Recording):
    """All joints at once, with the same keys: the error of a sample is the largest of any joint."""

    def __init__(self, body: Body, tolerance: float) -> None:
        # What stands still in its parent's space is the same between any keys.
        moves = _moves(body.poses) & body.free
        moves[0] |= not moves.any()
        super().__init__(body.times, body.poses[moves], body.mode, 0.0, tolerance)
        self.body, self.moving, self.everything = body, np.flatnonzero(moves), PackedPoses(body.poses)

    def errors(self, samples: np.ndarray, shown: Poses) -> np.ndarray:
        everything = self.everything[samples]
        everything[self.moving] = shown
        return self.in_tolerances(self.body.errors(everything, samples).max(axis=0), samples)


class _OwnKeys:
    """The search for keys that each joint has of its own.

    First every joint on a chain gets its share of the tolerance, for the largest displacement that its own error gives
    to anything that hangs on it: by the triangle inequality that is enough. Errors of joints seldom add up, though, so
    then keys are taken out for as long as the error in the root's space allows it: of all joints of a depth at once,
    since these do not move one another, with what hangs on them and what they hang on as it is shown by then.
    """

    off_at_keys = False

    def __init__(self, body: Body, tolerance: float) -> None:
        self.body, self.tolerance, self.shown = body, tolerance, body.poses.copy()
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
        rests = np.all(body.shell_errors(body.at_rest(), body.poses, sizes) <= shares, axis=1)
        self.shown[rests & body.free] = body.at_rest()[rests & body.free]
        moving = np.flatnonzero(~rests & body.free)
        if len(moving):
            times, starts = np.tile(body.times, len(moving)), count * np.arange(len(moving))
            size, share = sizes[moving].ravel(), shares[moving].ravel()
            search = Search(Recording(times, reshaped(body.poses[moving], -1), body.mode, size, share, starts))
            self._take(moving, search.thinned(search.measured(np.arange(len(times))), 1.0))

    def _sizes_and_shares(self) -> tuple[np.ndarray, np.ndarray]:
        """How large what hangs on each joint is and how far it may be off by that joint, both (joints, n).

        Both in the unit of the joint's parent. Joints that never move need no share.
        """
        body, skeleton = self.body, self.body.skeleton
        moves = (_moves(body.poses) & body.free).astype(np.int64)
        above, beneath = moves.copy(), moves.copy()
        for joints in skeleton.levels[1:]:
            above[joints] += above[skeleton.parents[joints]]
        for joints in skeleton.levels[:0:-1]:
            parents = skeleton.parents[joints]
            np.maximum.at(beneath, parents, moves[parents] + beneath[joints])
        weights = body.weights.copy()
        for joints in skeleton.levels[:0:-1]:
            np.maximum.at(weights, skeleton.parents[joints], weights[joints])
        longest_chain = np.maximum(above + beneath - moves, 1)
        shares = np.full(body.poses.shape, self.tolerance) / longest_chain[:, None]
        shares /= np.maximum(weights, TINY)
        if body.truth.scales is None:
            return body.sizes, shares
        on_joints = (skeleton.parents >= 0)[:, None]
        return body.sizes / body.truth.scales, shares / np.where(on_joints, body.truth.scales[skeleton.parents], 1.0)

    def _take(self, joints: np.ndarray, keys: Keys) -> None:
        """Note and show the keys of joints that were tracks."""
        count = len(self.body.times)
        bounds = np.searchsorted(keys.indices, count * np.arange(len(joints) + 1))
        for place, joint in enumerate(joints.tolist()):
            self._show(joint, keys.indices[bounds[place] : bounds[place + 1]] - count * place)

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
        rests = level.may_rest()
        for joint in joints[rests].tolist():
            self._show(joint, self.body.middles[[joint]])
        joints = joints[~rests]
        if len(joints):
            count = len(self.body.times)
            search = Search(self._level(joints) if rests.any() else level)
            tracks = [count * place + self.keys[joint] for place, joint in enumerate(joints.tolist())]
            self._take(joints, search.refined(search.thinned(search.measured(np.concatenate(tracks)), 1.0)))

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
        wanted = np.zeros(self.body.poses.shape, dtype=bool)
        wanted.flat[numbers] = True
        for joints in self.body.skeleton.levels[:0:-1]:
            np.logical_or.at(wanted, self.body.skeleton.parents[joints], wanted[joints])
        for joint in np.flatnonzero(wanted.any(axis=1) & self.body.free).tolist():
            ends = (0, len(self.body.times) - 1)
            self._show(joint, np.union1d(self.keys[joint], (*ends, *np.flatnonzero(wanted[joint]))))


class _ChannelKeys(_OwnKeys):
    """The same for rotations and locations: from the keys of joints, which both begin with, more are taken out.

    So there are never more of them. As one channel's keys go the other's stay, and what is off at them by the other
    counts: without that, the proof would put many back.
    """

    off_at_keys = True

    def __init__(self, channels: Channels, tolerance: float) -> None:
        super().__init__(channels.body, tolerance)
        self.channels = channels

    def _share_out(self) -> None:
        whole = _OwnKeys(self.channels.whole, self.tolerance).found()
        for node, keys in enumerate(self.channels.of_nodes(whole)):
            self._show(node, keys)


def _moves(poses: Poses) -> np.ndarray:
    """Which joints (joints, n) ever change in their parents' space, shape (joints,)."""
    numbers = [poses.positions, poses.quaternions] + ([] if poses.scales is None else [poses.scales])
    return np.any([changes(rows) for rows in numbers], axis=0)


def _mask(fixed: ArrayLike | None, joints: int) -> np.ndarray:
    """Which joints are fixed, shape (joints,). Numbers of joints are refused: 0 and 1 could mean either."""
    mask = np.zeros(joints, dtype=bool) if fixed is None else np.asarray(fixed)
    if mask.dtype != bool or mask.shape not in ((), (joints,)):
        raise ValueError(
            f"fixed needs True or False for each of {joints} joints: np.isin(np.arange({joints}), fixed) makes that of "
            "numbers of joints"
        )
    return np.broadcast_to(mask, (joints,))


def _one_for_each(given: ArrayLike, name: str, *shapes: tuple[int, ...]) -> np.ndarray:
    """A number for each joint or sample, or one for all: no damage and not below zero."""
    given = numbers(given, f"{name}s")
    if given.shape not in ((), *shapes):
        wanted = " or ".join(map(str, shapes))
        raise ValueError(f"{name} of shape {given.shape}: give one number, or an array of shape {wanted}")
    given = np.broadcast_to(given, shapes[0]) if given.ndim == 0 else given
    if not (valid := (given == 0.0) | ((given > 1.0 / LIMIT) & (given < LIMIT))).all():
        joint = np.argwhere(~valid)[0]
        raise ValueError(
            f"joint {joint[0]} has a {name} of {given[tuple(joint)]}: give 0, or a number from {1.0 / LIMIT:g} to "
            f"{LIMIT:g}"
        )
    return given
