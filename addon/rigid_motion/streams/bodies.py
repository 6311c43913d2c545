"""Streamed bodies: rigid bodies and skeletons, combined into one forest of joints.

A rigid body is a joint without a parent; a skeleton is a tree of joints. All bodies of a sender are sampled at the same
moments and stored in one array: poses of shape (joints,), each in its parent's space, metres and Blender's axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..motion import Poses, Skeleton, shell_error
from ..motion.humanoid import relative_to_followed
from ..motion.poses import joined
from ..motion.quaternions import normalise

DEFAULT_RADIUS_M = 0.03
"""Default radius of the ball around every joint, in metres."""

MIN_LENGTH_M, MAX_LENGTH_M = 1e-6, 1e4
"""Smallest radius and tolerance in metres; and the upper limit of radii, tolerances and coordinates in metres."""

MIN_SAMPLE_GAP_S, MAX_CLOCK_S = 1e-6, 2e11
"""Shortest time between samples in seconds; and largest clock value in seconds, where floats still resolve ticks."""

MOST_BODIES, MOST_JOINTS, LONGEST_NAME = 255, 1024, 255
"""Limits of a sender; the length of a name is in bytes of UTF-8."""

MOST_NAMED = 40
"""Most names of joints or bodies listed in an error message."""

LEVER_LEVELS = 144
"""Levels of the distance between a held object and its holder: `MIN_LENGTH_M` times 2 ** (level / 4), with level
below this number."""


def checked(poses: Poses, names: Sequence[str]) -> Poses:
    """Return poses (joints,) with quaternions normalised to length 1.

    Raises ValueError with the name of a joint whose position is out of range or whose quaternion is invalid.
    """
    longest = np.abs(poses.quaternions).max(axis=-1, initial=0.0)
    are_sound = (np.abs(poses.positions) < MAX_LENGTH_M).all(axis=-1) & (longest > 0.0) & np.isfinite(longest)
    if not are_sound.all():
        needs = f"a place within {MAX_LENGTH_M:g} m, and a quaternion of finite numbers, not all of them 0"
        raise ValueError(f"{names[int(np.argmin(are_sound))]}: a pose needs {needs}")
    return Poses(poses.positions, normalise(poses.quaternions / longest[..., None]))


@dataclass(frozen=True, eq=False)
class StreamBody:
    """A rigid body or a skeleton, at rest.

    Raises ValueError if the numbers of names, parents, radii and poses differ or values are out of range, or if a joint
    comes before its parent.
    """

    name: str

    joints: tuple[str, ...]

    parents: np.ndarray
    """Number of each joint's parent in this body, lower than the joint's own, -1 for roots. Shape (joints,)."""

    rest: Poses
    """Rest pose of each joint in its parent's space, shape (joints,)."""

    radius: float | np.ndarray = DEFAULT_RADIUS_M
    """Radius in metres of the ball at every joint in which no point may move off by more than the tolerance. One for
    all joints, or one for each, shape (joints,), by the size of what the joint carries.
    """

    sliding: np.ndarray | None = None
    """Whether each joint changes its position in its parent's space, shape (joints,). None: roots only."""

    def __post_init__(self) -> None:
        parents, count = np.asarray(self.parents, dtype=np.int64), len(self.joints)
        sliding = parents < 0 if self.sliding is None else np.asarray(self.sliding, dtype=bool)
        if not (count and parents.shape == sliding.shape == self.rest.shape == (count,)):
            raise ValueError(f"{self.name}: names, parents and rest poses of its {count} joints are not as many")
        if np.any(parents < -1) or np.any(parents >= np.arange(count)):
            raise ValueError(f"{self.name}: a joint needs to come after its parent")
        radii = np.asarray(self.radius, dtype=np.float64)
        if radii.shape not in ((), (count,)) or not ((radii >= MIN_LENGTH_M) & (radii < MAX_LENGTH_M)).all():
            raise ValueError(
                f"{self.name}: a radius is one for all joints or for each, {MIN_LENGTH_M:g} to {MAX_LENGTH_M:g} m"
            )
        names = (self.name, *self.joints)
        if not all(0 < len(name.encode(errors="replace")) <= LONGEST_NAME for name in names):
            raise ValueError(f"{self.name}: a name needs 1 to {LONGEST_NAME} bytes")
        object.__setattr__(self, "rest", checked(self.rest, [f"{label} at rest" for label in self.labels]))
        object.__setattr__(self, "radius", np.broadcast_to(radii, (count,)))
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "sliding", sliding)

    @cached_property
    def skeleton(self) -> Skeleton:
        """The hierarchy of the joints."""
        return Skeleton(self.parents)

    @cached_property
    def labels(self) -> list[str]:
        """Names of joints for messages, with the body's name."""
        return [self.name if joint == self.name else f"{self.name}, {joint}" for joint in self.joints]

    def in_root_space(self, poses: Poses) -> Poses:
        """Return poses (joints,) in parents' spaces converted to the space of the roots."""
        return self.skeleton.in_root_space(poses[:, None])[:, 0]

    @classmethod
    def rigid(cls, name: str, pose: Poses | None = None, radius: float = DEFAULT_RADIUS_M) -> StreamBody:
        """Return a single rigid body, at rest at `pose` (1,), or at the origin."""
        return cls(name, (name,), np.array([-1]), pose or Poses([[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]]), radius)


class Hold(NamedTuple):
    """A held body: its number, the number of the joint that holds it, and the level of their distance."""

    body: int
    joint: int
    level: int = 0


class Forest:
    """All bodies of a sender as one array of joints; some bodies may be held by joints of others."""

    def __init__(self, bodies: Sequence[StreamBody]) -> None:
        self.bodies, self.names = tuple(bodies), {body.name for body in bodies}
        if not bodies or len(self.names) < len(bodies):
            raise ValueError("a sender needs bodies, each with a name of its own")
        counts = [len(body.joints) for body in bodies]
        if len(bodies) > MOST_BODIES or sum(counts) > MOST_JOINTS:
            raise ValueError(f"more than {MOST_BODIES} bodies or {MOST_JOINTS} joints are too many for one sender")
        self._ends = np.cumsum(counts)
        parents = np.concatenate([body.parents for body in bodies])
        self.parents = np.where(parents < 0, -1, parents + np.repeat(self._ends - counts, counts))
        self.rest = joined([body.rest for body in bodies])
        self.radii = np.concatenate([body.radius for body in bodies])
        self.sliding = np.concatenate([body.sliding for body in bodies])
        self.skeleton = Skeleton(self.parents)
        self.labels = [label for body in bodies for label in body.labels]
        self.holds: tuple[Hold, ...] = ()
        self.holders = np.full(len(self), -1, dtype=np.int16)
        """The joint that holds each joint, -1 for none, shape (joints,)."""
        self._bone_lengths = np.linalg.norm(self.rest.positions, axis=1)
        """Distance of each joint from its parent, shape (joints,)."""

    def __len__(self) -> int:
        return len(self.parents)

    def holding(self, holds: tuple[Hold, ...]) -> Forest:
        """Return these bodies with the given holds: roots of held bodies are in the space of their holders.

        This forest must hold nothing. Raises ValueError if a body holds itself, even indirectly, or has a root that
        never changes its position.
        """
        forest, _ = copy(self), self.groups
        forest.__dict__.pop("reaches", None)
        forest.holds, forest.rest = holds, self.rest.copy()
        forest.holders, forest._bone_lengths = self.holders.copy(), self._bone_lengths.copy()
        for body, joint, level in holds:
            roots = self._roots(body)
            if not self.sliding[roots].all():
                raise ValueError(f"{self.bodies[body].name}: what never changes its place cannot be held")
            forest.holders[roots], forest._bone_lengths[roots] = joint, MIN_LENGTH_M * 2.0 ** (level / 4.0)
            forest.rest.positions[roots], forest.rest.quaternions[roots] = 0.0, (1.0, 0.0, 0.0, 0.0)
        forest.parents = np.where(forest.holders >= 0, forest.holders, self.parents)
        forest.skeleton = Skeleton(forest.parents)
        return forest

    def _roots(self, body: int) -> np.ndarray:
        first = self._ends[body] - len(self.bodies[body].joints)
        return first + np.flatnonzero(self.bodies[body].parents < 0)

    def joint(self, body: str, joint: str | None = None) -> int:
        """Return the number of a joint, or of a body's only joint. Raises ValueError if it does not exist."""
        number = self.body(body)
        joints = self.bodies[number].joints
        if joint is None and len(joints) == 1:
            joint = joints[0]
        if joint not in joints:
            raise ValueError(f"{body}: {joint or 'which joint'}? It has {', '.join(joints[:MOST_NAMED])}")
        return int(self._ends[number]) - len(joints) + joints.index(joint)

    def body(self, name: str) -> int:
        """Return the number of a body. Raises ValueError if it does not exist."""
        names = [body.name for body in self.bodies]
        if name not in names:
            raise ValueError(f"{name}: no such body; there are {', '.join(names[:MOST_NAMED])}")
        return names.index(name)

    def held(self, holders: np.ndarray) -> dict[str, tuple[str, str]]:
        """Return the body and joint that hold each held body, by name, given the holders (joints,)."""
        hands = {body.name: int(holders[self._roots(row)[0]]) for row, body in enumerate(self.bodies)}
        return {name: self._joint_name(joint) for name, joint in hands.items() if joint >= 0}

    def _joint_name(self, joint: int) -> tuple[str, str]:
        number = int(np.searchsorted(self._ends, joint, side="right"))
        body = self.bodies[number]
        return body.name, body.joints[joint - int(self._ends[number])]

    def level(self, body: int, poses: Poses) -> int:
        """Return the level of a held body's distance from its holder, given its poses (joints,) in that space."""
        far = max(np.linalg.norm(poses.positions[self._roots(body)], axis=1).max(), MIN_LENGTH_M)
        return min(math.ceil(4.0 * math.log2(far / MIN_LENGTH_M)), LEVER_LEVELS - 1)

    def in_hands(self, poses: Poses) -> Poses:
        """Return poses (joints,) with held bodies converted from the roots' space to the space of their holders."""
        parents = np.where(self.holders >= 0, -1, self.parents)
        result, held = poses.copy(), self.holders >= 0
        if held.any():
            there = Skeleton(parents).in_root_space(poses[:, None])[:, 0]
            result[held] = relative_to_followed(there, self.holders)[held]
        return result

    def out_of_hands(self, poses: Poses, holders: np.ndarray) -> Poses:
        """Return poses (joints, n) with held bodies in the roots' space. `holders` has shape (joints, n) or (1, n)."""
        if not (holders >= 0).any():
            return poses
        result = poses.copy()
        for hands in np.unique(holders, axis=1).T:
            held, some = np.flatnonzero(hands >= 0), np.flatnonzero((holders == hands[:, None]).all(axis=0))
            there = Skeleton(np.where(hands >= 0, hands, self.parents)).in_root_space(poses[:, some])
            result[np.ix_(held, some)] = there[held]
        return result

    def joined(self, poses: Mapping[str, Poses]) -> Poses:
        """Return the poses of all joints (joints,), given the poses of each body by name."""
        return joined([poses[body.name] for body in self.bodies])

    def parted(self, poses: Poses) -> dict[str, Poses]:
        """Return the poses of each body by name, given the poses of all joints (joints, ...)."""
        return {
            body.name: poses[end - len(body.joints) : end] for body, end in zip(self.bodies, self._ends, strict=True)
        }

    def errors(self, shown: Poses, truth: Poses) -> np.ndarray:
        """Return the largest displacement of any point in each joint's ball, in metres, for poses (joints, n) in their
        parents' spaces, shape (joints, n).
        """
        in_root_space = self.skeleton.in_root_space
        return shell_error(in_root_space(shown), in_root_space(truth), self.radii[:, None])

    @cached_property
    def groups(self) -> list[tuple[int, int, int]]:
        """The groups of numbers that describe a pose, in order: joint, 1 for position or 0 for turn, and parent group.

        The parent group is that of the same kind at the joint's parent, or else the parent's rotation; -1 for roots.
        """
        groups = [(joint, slide) for joint, slides in enumerate(self.sliding.tolist()) for slide in range(1 + slides)]
        numbers, parents = {group: number for number, group in enumerate(groups)}, self.parents.tolist()
        above = [numbers.get((parents[joint], slide), numbers.get((parents[joint], 0), -1)) for joint, slide in groups]
        return [(*group, number) for group, number in zip(groups, above, strict=True)]

    @cached_property
    def reaches(self) -> np.ndarray:
        """Largest distance from each joint to anything below it, including the balls around joints, shape (joints,)."""
        reaches = self.radii.copy()
        for joints in self.skeleton.levels[:0:-1]:
            np.maximum.at(reaches, self.parents[joints], self._bone_lengths[joints] + reaches[joints])
        return reaches
