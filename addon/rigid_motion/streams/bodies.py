"""What is streamed: rigid bodies and skeletons, as one forest of joints.

A rigid body is a joint that hangs on nothing; a skeleton is a tree of joints. All bodies of a sender are sampled at the
same moments, and are one array: poses of shape (joints,), each in its parent's space, metres and Blender's axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..motion import Poses, Skeleton, shell_error
from ..motion.poses import joined
from ..motion.quaternions import normalise

RADIUS = 0.03
"""Of the ball at every joint, in metres, unless it is given."""

SMALLEST, LARGEST = 1e-6, 1e4
"""Metres of radii and tolerances at least; and metres that these are less than, and coordinates of places."""

SHORTEST, FURTHEST = 1e-6, 2e11
"""Seconds between two samples at least; and those of a clock, either way: beyond, floats do not tell ticks apart."""

MOST_BODIES, MOST_JOINTS, LONGEST_NAME = 255, 1024, 255
"""Of a sender; and bytes of a name in UTF-8."""


def checked(poses: Poses, names: Sequence[str]) -> Poses:
    """Return poses (joints,) with quaternions of length 1, however long they were.

    Raises ValueError with the name of a joint that is nowhere, or turned by nothing.
    """
    longest = np.abs(poses.quaternions).max(axis=-1, initial=0.0)
    are_sound = (np.abs(poses.positions) < LARGEST).all(axis=-1) & (longest > 0.0) & np.isfinite(longest)
    if not are_sound.all():
        needs = f"a place within {LARGEST:g} m, and a quaternion of finite numbers, not all of them 0"
        raise ValueError(f"{names[int(np.argmin(are_sound))]}: a pose needs {needs}")
    return Poses(poses.positions, normalise(poses.quaternions / longest[..., None]))


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body or a skeleton, at rest.

    Raises ValueError where names, parents, radii and poses are not as many or out of range, or a joint comes before its
    parent.
    """

    name: str

    joints: tuple[str, ...]

    parents: np.ndarray
    """The number of each joint's parent in this body, lower than its own, -1 for roots. Shape (joints,)."""

    rest: Poses
    """Each joint in its parent's space, shape (joints,)."""

    radius: float | np.ndarray = RADIUS
    """Of the ball at every joint within which nothing may move off by more than the tolerance, in metres. One for all,
    or one for each, shape (joints,), as what it carries is large.
    """

    sliding: np.ndarray | None = None
    """Which joints change their places in their parents' space, shape (joints,). None for roots alone."""

    def __post_init__(self) -> None:
        parents, count = np.asarray(self.parents, dtype=np.int64), len(self.joints)
        sliding = parents < 0 if self.sliding is None else np.asarray(self.sliding, dtype=bool)
        if not (count and parents.shape == sliding.shape == self.rest.shape == (count,)):
            raise ValueError(f"{self.name}: names, parents and rest poses of its {count} joints are not as many")
        if np.any(parents < -1) or np.any(parents >= np.arange(count)):
            raise ValueError(f"{self.name}: a joint needs to come after its parent")
        radii = np.asarray(self.radius, dtype=np.float64)
        if radii.shape not in ((), (count,)) or not ((radii >= SMALLEST) & (radii < LARGEST)).all():
            raise ValueError(f"{self.name}: a radius is one for all joints or for each, {SMALLEST:g} to {LARGEST:g} m")
        names = (self.name, *self.joints)
        if not all(0 < len(name.encode(errors="replace")) <= LONGEST_NAME for name in names):
            raise ValueError(f"{self.name}: a name needs 1 to {LONGEST_NAME} bytes")
        object.__setattr__(self, "rest", checked(self.rest, [f"{label} at rest" for label in self.labels]))
        object.__setattr__(self, "radius", np.broadcast_to(radii, (count,)))
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "sliding", sliding)

    @cached_property
    def skeleton(self) -> Skeleton:
        """Which joint hangs on which."""
        return Skeleton(self.parents)

    @cached_property
    def labels(self) -> list[str]:
        """What joints are called where there are others."""
        return [self.name if joint == self.name else f"{self.name}, {joint}" for joint in self.joints]

    def in_root_space(self, poses: Poses) -> Poses:
        """Return poses (joints,) of the joints, each in its parent's space, as they are in that of the roots."""
        return self.skeleton.in_root_space(poses[:, None])[:, 0]

    @classmethod
    def rigid(cls, name: str, pose: Poses | None = None, radius: float = RADIUS) -> Body:
        """Return a single rigid body, at rest at `pose` (1,), or in the middle of everything."""
        return cls(name, (name,), np.array([-1]), pose or Poses([[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]]), radius)


class Forest:
    """All bodies of a sender, as one array of joints."""

    def __init__(self, bodies: Sequence[Body]) -> None:
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

    def __len__(self) -> int:
        return len(self.parents)

    def joined(self, poses: Mapping[str, Poses]) -> Poses:
        """Return the poses of all joints (joints,), of those of each body by its name."""
        return joined([poses[body.name] for body in self.bodies])

    def parted(self, poses: Poses) -> dict[str, Poses]:
        """Return the poses of each body by its name, of those of all joints (joints, ...)."""
        return {
            body.name: poses[end - len(body.joints) : end] for body, end in zip(self.bodies, self._ends, strict=True)
        }

    def errors(self, shown: Poses, truth: Poses) -> np.ndarray:
        """Return how far off any point of each joint's ball is at most, in metres, of poses (joints, n) in their
        parents' spaces, shape (joints, n).
        """
        in_root_space = self.skeleton.in_root_space
        return shell_error(in_root_space(shown), in_root_space(truth), self.radii[:, None])

    @cached_property
    def groups(self) -> list[tuple[int, int, int]]:
        """What is said of a pose, in its order: the joint, 1 for its place and 0 for its turn, and the group above.

        That is the one of the same kind of the joint's parent or, where it has none, the parent's turn; -1 for roots.
        """
        groups = [(joint, slide) for joint, slides in enumerate(self.sliding.tolist()) for slide in range(1 + slides)]
        numbers, parents = {group: number for number, group in enumerate(groups)}, self.parents.tolist()
        above = [numbers.get((parents[joint], slide), numbers.get((parents[joint], 0), -1)) for joint, slide in groups]
        return [(*group, number) for group, number in zip(groups, above, strict=True)]

    @cached_property
    def reaches(self) -> np.ndarray:
        """How far from each joint anything is that hangs on it, with the balls around it, shape (joints,)."""
        reaches = self.radii.copy()
        arms = np.linalg.norm(self.rest.positions, axis=1)
        for joint in np.flatnonzero(self.parents >= 0)[::-1]:
            parent = self.parents[joint]
            reaches[parent] = max(reaches[parent], arms[joint] + reaches[joint])
        return reaches
