"""How many whole turns a body makes between two keys, worked out one segment at a time, by `mathutils`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mathutils import Euler, Quaternion, Vector

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply


class Spin(NamedTuple):
    """Turns about an axis that stands still in space, or in the body."""

    turns: int = 0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    in_space: bool = False

    def add_to(self, poses: Poses, shares: np.ndarray) -> Poses:
        """Poses (m,) turned as far as these shares (m,) of the segment say."""
        spun = np.array([Quaternion(self.axis, 2.0 * np.pi * self.turns * share) for share in shares]).reshape(-1, 4)
        first, second = (spun, poses.quaternions) if self.in_space else (poses.quaternions, spun)
        return Poses(poses.positions, multiply(first, second), poses.scales)

    def twist(self, quaternion: Sequence[float]) -> np.ndarray:
        """The angular velocity in unit time, with a twist's places for what it does not move, (7,)."""
        axis = Vector(self.axis)
        if self.in_space:
            axis.rotate(Quaternion(quaternion).inverted())
        return np.concatenate((2.0 * np.pi * self.turns * np.array(axis), np.zeros(4)))


def shortest(first: Sequence[float], second: Sequence[float]) -> np.ndarray:
    """The rotation from one quaternion to another as a vector along the axes of the body.

    At half a turn it is the one that `interpolate` takes, of which rounding errors decide.
    """
    aligned = -np.array(second) if np.dot(first, second) < 0.0 else np.array(second)
    w, *xyz = multiply(np.array(first) * (1.0, -1.0, -1.0, -1.0), aligned)
    length = np.linalg.norm(xyz)
    return np.array(xyz) * (2.0 * np.arctan2(length, abs(w)) / max(length, 1e-12))


def spin_by_angles(
    angles: np.ndarray, order: str, quaternions: np.ndarray, own: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
) -> Spin:
    """The turns of Euler angles (2, 3) beyond the shortest rotation of quaternions (2, 4) with `own` on top."""
    change = angles[1] - angles[0]
    which = int(np.argmax(np.abs(change)))
    if abs(change[which]) <= np.pi - 1e-4:
        return Spin()
    in_space, in_body = [], []
    for set_of_angles, quaternion in zip(angles, quaternions, strict=True):
        further = set_of_angles.copy()
        further[which] += 1.0
        turn = Euler(further, order).to_quaternion() @ Euler(set_of_angles, order).to_quaternion().inverted()
        axis = Quaternion(own) @ Vector(turn.to_exponential_map()).normalized()
        in_space.append(axis)
        in_body.append(Quaternion(quaternion).inverted() @ axis)
    stands = (in_space[1] - in_space[0]).length < (in_body[1] - in_body[0]).length
    axis = sum(in_space if stands else in_body, Vector((0.0, 0.0, 0.0))).normalized()
    turn = Vector(shortest(*quaternions))
    if stands:
        turn.rotate(Quaternion(quaternions[0]))
    return Spin(round((change[which] - turn.dot(axis)) / (2.0 * np.pi)), tuple(axis), stands)


def with_channel(spin: Spin, turns: int, quaternions: np.ndarray, axis: str = "SCREW") -> Spin:
    """The same with the turns of the channel on top."""
    if not turns:
        return spin
    if spin.turns:
        return spin._replace(turns=spin.turns + turns * (1 if spin.turns > 0 else -1))
    turn = shortest(*quaternions)
    if axis == "SCREW" and np.linalg.norm(turn) >= 1e-4:
        return Spin(turns, tuple(turn / np.linalg.norm(turn)))
    return Spin(turns, tuple(np.eye(3)["XYZ".find(axis)]))
