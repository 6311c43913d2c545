"""Joints that do not depend on one another, as tracks of one recording: errors are those of the joints below them."""

from __future__ import annotations

import itertools

import numpy as np

from .bodies import Body
from .key_costs import SampleTracks
from .measures import largest_displacement
from .poses import Poses, inverse, packed, placed, reshaped
from .quaternions import components, conjugate, cross, matrices, multiply

AT_ONCE = 2**13
"""Poses processed at once, to fit the processor's caches."""


class Level(SampleTracks):
    """Tracks of joints. The error of a sample is the largest error of its joint and all joints below.

    Parameters
    ----------
    body : Body
    joints : array of int, shape (j,)
        The joints; none of them is below another.
    shown : Poses, shape (joints, n)
        The poses of all joints of the body with the present keys, in their parents' space.
    tolerance : float
        The tolerance of the shell error.
    off_at_keys : bool
        As in `SampleTracks`.
    """

    def __init__(
        self, body: Body, joints: np.ndarray, shown: Poses, tolerance: float, off_at_keys: bool = False
    ) -> None:
        self.body, self.joints = body, joints
        count = len(body.times)
        starts = count * np.arange(len(joints))
        poses = reshaped(body.poses[joints], -1)
        super().__init__(np.tile(body.times, len(joints)), poses, body.mode, 0.0, tolerance, starts, off_at_keys)
        weighs = body.weights.any(axis=1)
        below = map(body.skeleton.below, joints.tolist())
        weighty = [hanging[weighs[hanging]] for hanging in below]
        self.counts = np.array([len(hanging) for hanging in weighty])
        self.poses_each = self.counts.mean()
        there = body.skeleton.in_root_space(shown)
        above = body.skeleton.parents[joints]
        on_roots = above < 0
        parents = there[np.where(on_roots, 0, above)]
        parents[on_roots] = Poses((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 1.0)
        self.parents, self.back = (packed(reshaped(poses, -1)) for poses in (parents, inverse(there[joints])))
        self.carried = [
            _Carried(there[hanging], body.truth[hanging], body.radii[hanging], body.weights[hanging])
            for hanging in weighty
        ]

    def errors(self, samples: np.ndarray, shown: Poses) -> np.ndarray:
        track, moment = np.divmod(samples, len(self.body.times))
        # The motion that moves a joint from its present pose to the new one moves all joints below it too.
        by = placed(placed(self.parents[samples], shown), self.back[samples])
        rows = [*matrices(by.quaternions).reshape(9, -1), *components(by.positions), *components(by.quaternions)]
        motions = np.stack(rows if by.scales is None else [*rows, by.scales])
        largest = np.empty(len(samples))
        # Samples are sorted by track, or nearly so.
        for first, end in itertools.pairwise([0, *(np.flatnonzero(np.diff(track)) + 1).tolist(), len(samples)]):
            some = slice(first, end)
            largest[some] = self.carried[track[first]].largest_errors(moment[some], motions[:, some])
        return self.in_tolerances(largest, samples)

    def may_rest(self) -> np.ndarray:
        """Return which of the joints need not move at all, shape (j,)."""
        matter, count = self.counts > 0, len(self.body.times)
        still = self.body.at_rest()[np.repeat(self.joints[matter], count), 0]
        errors = self.errors(np.flatnonzero(np.repeat(matter, count)), still)
        rest = ~matter
        rest[matter] = errors.reshape(-1, count).max(axis=1) <= 1.0
        return rest


class _Carried:
    """Balls on joints (j,) that a joint above carries along: their present and desired poses (j, n)."""

    def __init__(self, there: Poses, desired: Poses, radii: np.ndarray, weights: np.ndarray) -> None:
        self.radii = radii[:, None]
        turned = multiply(there.quaternions, conjugate(desired.quaternions))
        rows = [weights, *components(there.positions), *components(desired.positions), *components(turned)]
        self.rows = np.stack(rows if there.scales is None else [*rows, there.scales, desired.scales])

    def largest_errors(self, moments: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return the largest error of any ball at each of moments (m,), moved by motions (.., m), shape (m,)."""
        result, step = np.empty(len(moments)), max(1, AT_ONCE // len(self.radii))
        for first in range(0, len(moments), step):
            some = slice(first, first + step)
            rows = self.rows.take(moments[some], axis=2)
            errors = rows[0] * _errors(motions[:, None, some], rows[1:], self.radii)
            errors.max(axis=0, out=result[some])
        return result


def _errors(motions: np.ndarray, rows: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return the shell errors (j, m) of balls in rows (.., j, m) of `_Carried`, moved by motions (.., 1, m)."""
    turn, positions, quaternions = motions[:9], motions[9:12], motions[12:16]
    there, desired, turned = rows[:3], rows[3:6], rows[6:10]
    d = turn[0::3] * there[0]
    d += turn[1::3] * there[1]
    d += turn[2::3] * there[2]
    if len(motions) > 16:
        d *= motions[16]
    d += positions
    d -= desired
    v = cross(quaternions[1:], turned[1:])
    v += quaternions[0] * turned[1:]
    v += turned[0] * quaternions[1:]
    if len(motions) == 16:
        return largest_displacement(d, v, radius)
    return largest_displacement(d, v, radius * motions[16] * rows[10], radius * rows[11])
