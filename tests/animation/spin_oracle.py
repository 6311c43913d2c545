"""How many turns a body makes between two keys, worked out one segment at a time, by `mathutils`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mathutils import Euler, Quaternion, Vector

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply


class Spin(NamedTuple):
    """Turns about an axis that stands still in space, or in the body."""

    turns: float = 0
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


def about_one_axis(first: Sequence[float], second: Sequence[float]) -> float:
    """By how much an angle about an axis (4,) changes to another one, 0 where the axes are not parallel."""
    lengths = np.linalg.norm(first[1:]) * np.linalg.norm(second[1:])
    dot = float(np.dot(first[1:], second[1:]))
    is_parallel = lengths > 0.0 and abs(dot) >= (1.0 - 1e-6) * lengths
    return float(np.sign(dot) * second[0] - first[0]) if is_parallel else 0.0


def _axis_of_angles(
    angles: np.ndarray, order: str, quaternions: np.ndarray, own: Sequence[float]
) -> tuple[float, Vector, bool]:
    """How far that of two sets of Euler angles (2, 3) goes which goes furthest; its axis, and whether in space.

    Or of angles about axes (2, 4).
    """
    if order == "AXIS_ANGLE":
        return about_one_axis(*angles), Vector(angles[0, 1:]).normalized(), False
    change = angles[1] - angles[0]
    which = int(np.argmax(np.abs(change)))
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
    return float(change[which]), axis, stands


def _about(spin: Spin, first: Sequence[float], second: Sequence[float]) -> float:
    """How far the shortest rotation goes about the axis of a spin."""
    turn = Vector(shortest(first, second))
    if spin.in_space:
        turn.rotate(Quaternion(first))
    return turn.dot(Vector(spin.axis))


def spin_and_end(
    quaternions: np.ndarray,
    turns: float,
    *,
    angles: np.ndarray | None = None,
    order: str = "XYZ",
    own: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    whole: bool = False,
) -> tuple[Spin, np.ndarray]:
    """The spin between two quaternions (2, 4), and where the body turns to without it, (4,).

    With the turns that Euler angles (2, 3), or angles and axes (2, 4), say, and those of the channel on top; what is
    not whole of these is a part of the rotation, unless `whole` turns are wanted.
    """
    first, second = quaternions
    part = 0.0 if abs(turns - round(turns)) < 1e-5 else turns - round(turns)
    spin, sense, change = Spin(), 0, 0.0
    if angles is not None:
        change, about, stands = _axis_of_angles(angles, order, quaternions, own)
        # A key that took what was seen is off by what in-betweens are.
        if (part and abs(change) > 1e-5) or abs(change) > np.pi - 1e-4:
            spin, sense = Spin(0, tuple(about), stands), 1 if change > 0.0 else -1
    if sense:
        end = _without(spin._replace(turns=sense * part), second)
        lacking = round((change - 2.0 * np.pi * sense * part - _about(spin, first, end)) / (2.0 * np.pi))
        sense = sense if lacking or part else 0
        spin = spin._replace(turns=lacking + sense * turns)
    if not sense and turns:
        turn = shortest(first, second)
        length = np.linalg.norm(turn)
        spin = Spin(turns, tuple(turn / length)) if length >= 1e-4 else Spin(turns)
        end = _without(spin._replace(turns=part), second)
    elif not sense:
        end = second
    if part and whole:
        total = _about(spin, first, end) + 2.0 * np.pi * spin.turns
        return spin._replace(turns=round((total - _about(spin, first, second)) / (2.0 * np.pi))), second
    return spin, end


def _without(spin: Spin, quaternion: np.ndarray) -> np.ndarray:
    """A quaternion turned back by a spin; to the last bit where that is by nothing."""
    if not spin.turns:
        return quaternion
    angle = -2.0 * np.pi * spin.turns
    back = np.concatenate(((np.cos(0.5 * angle),), np.sin(0.5 * angle) * np.array(spin.axis)))
    return multiply(back, quaternion) if spin.in_space else multiply(np.array(quaternion), back)
