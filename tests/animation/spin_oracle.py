"""Oracle for the number of turns between two keys, worked out one segment at a time with `mathutils`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mathutils import Euler, Quaternion, Vector

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply


class Spin(NamedTuple):
    """Turns about an axis that is fixed in space or in the body."""

    turns: float = 0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    in_space: bool = False

    def add_to(self, poses: Poses, shares: np.ndarray) -> Poses:
        """Return poses (m,), turned in proportion to these fractions (m,) of the segment."""
        spun = np.array([Quaternion(self.axis, 2.0 * np.pi * self.turns * share) for share in shares]).reshape(-1, 4)
        first, second = (spun, poses.quaternions) if self.in_space else (poses.quaternions, spun)
        return Poses(poses.positions, multiply(first, second), poses.scales)

    def twist(self, quaternion: Sequence[float]) -> np.ndarray:
        """Return the angular velocity per unit of time, padded with zeros to a twist, shape (7,)."""
        axis = Vector(self.axis)
        if self.in_space:
            axis.rotate(Quaternion(quaternion).inverted())
        return np.concatenate((2.0 * np.pi * self.turns * np.array(axis), np.zeros(4)))


def shortest(first: Sequence[float], second: Sequence[float]) -> np.ndarray:
    """Return the rotation from one quaternion to another as a vector along the axes of the body.

    At half a turn, return the direction that `interpolate` takes, which depends on rounding errors.
    """
    aligned = -np.array(second) if np.dot(first, second) < 0.0 else np.array(second)
    w, *xyz = multiply(np.array(first) * (1.0, -1.0, -1.0, -1.0), aligned)
    length = np.linalg.norm(xyz)
    return np.array(xyz) * (2.0 * np.arctan2(length, abs(w)) / max(length, 1e-12))


def about_one_axis(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the change of the angle from one angle and axis (4,) to another; 0 if the axes are not parallel."""
    lengths = np.linalg.norm(first[1:]) * np.linalg.norm(second[1:])
    dot = float(np.dot(first[1:], second[1:]))
    is_parallel = lengths > 0.0 and abs(dot) >= (1.0 - 1e-6) * lengths
    return float(np.sign(dot) * second[0] - first[0]) if is_parallel else 0.0


def _axis_of_angles(
    angles: np.ndarray, order: str, quaternions: np.ndarray, own: Sequence[float]
) -> tuple[float, Vector, bool]:
    """Return the largest change among Euler angles (2, 3), its axis, and whether the axis is fixed in space.

    Angles and axes (2, 4) are accepted, too.
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


def _angle_about_spin_axis(spin: Spin, first: Sequence[float], second: Sequence[float]) -> float:
    """Return the angle of the shortest rotation about the axis of a spin."""
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
    """Return the spin between two quaternions (2, 4), and the end rotation without the spin, (4,).

    Turns come from Euler angles (2, 3), or from angles and axes (2, 4), plus `turns` of the channel. A fraction of a
    turn is part of the rotation, unless `whole` turns are requested.
    """
    first, second = quaternions
    part = 0.0 if abs(turns - round(turns)) < 1e-5 else turns - round(turns)
    spin, sense, change = Spin(), 0, 0.0
    if angles is not None:
        change, about, stands = _axis_of_angles(angles, order, quaternions, own)
        # A key inserted at the displayed pose has the error of the in-betweens.
        if (part and abs(change) > 1e-5) or abs(change) > np.pi - 1e-4:
            spin, sense = Spin(0, tuple(about), stands), 1 if change > 0.0 else -1
    if sense:
        end = _turned_back(spin._replace(turns=sense * part), second)
        lacking = round(
            (change - 2.0 * np.pi * sense * part - _angle_about_spin_axis(spin, first, end)) / (2.0 * np.pi)
        )
        sense = sense if lacking or part else 0
        spin = spin._replace(turns=lacking + sense * turns)
    if not sense and turns:
        turn = shortest(first, second)
        length = np.linalg.norm(turn)
        spin = Spin(turns, tuple(turn / length)) if length >= 1e-4 else Spin(turns)
        end = _turned_back(spin._replace(turns=part), second)
    elif not sense:
        end = second
    if part and whole:
        total = _angle_about_spin_axis(spin, first, end) + 2.0 * np.pi * spin.turns
        return spin._replace(turns=round((total - _angle_about_spin_axis(spin, first, second)) / (2.0 * np.pi))), second
    return spin, end


def _turned_back(spin: Spin, quaternion: np.ndarray) -> np.ndarray:
    """Return a quaternion turned back by a spin; exactly the same quaternion if the spin has no turns."""
    if not spin.turns:
        return quaternion
    angle = -2.0 * np.pi * spin.turns
    back = np.concatenate(((np.cos(0.5 * angle),), np.sin(0.5 * angle) * np.array(spin.axis)))
    return multiply(back, quaternion) if spin.in_space else multiply(np.array(quaternion), back)
