"""Where breakdowns lie beside the path of a mode, and how that is made up for, worked out apart from the program."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses

if TYPE_CHECKING:
    from tests.animation.oracle import Path


DEPENDS_ON_KEYS = {"pga_lerp", "cga_lerp", "motor_spline"}
"""Another key on the path of one of these would make another path of it."""


def lies_on_path(curves: list[bpy.types.FCurve], frame: float, mode: str) -> bool:
    """Whether a key between others is a breakdown in all channels, where that matters."""
    types = {next((key.type for key in curve.keyframe_points if key.co[0] == frame), None) for curve in curves}
    repeats = any(modifier.type == "CYCLES" and not modifier.mute for curve in curves for modifier in curve.modifiers)
    return mode in DEPENDS_ON_KEYS and not repeats and types == {"BREAKDOWN"}


def beside_path(path: Path, ends: Poses, share: np.ndarray) -> Poses:
    """The poses between two keys (2,) of which at least one is a breakdown: along the path, and as far off as they."""
    places = [0.0, 1.0]
    moves = [np.eye(4), np.eye(4)]
    growths = np.zeros(2)
    for number in (0, 1):
        key = ends[number : number + 1]
        places[number] = _nearest(path, key)
        at = path.poses(np.array(places[number : number + 1]))
        moves[number] = np.linalg.inv(_matrices(at)[0]) @ _matrices(key)[0]
        growths[number] = 0.0 if key.scales is None else np.log(key.scales[0] / at.scales[0])
    begin, end = places
    poses = path.poses(begin + (end - begin) * share)
    blend = np.clip(share, 0.0, 1.0)
    if path.mode == "motor_spline":
        blend = blend * blend * (3.0 - 2.0 * blend)
    change = _logarithm(np.linalg.inv(moves[0]) @ moves[1])
    worlds = _matrices(poses) @ moves[0] @ np.array([_exponential(part * change) for part in blend]).reshape(-1, 4, 4)
    quaternions = Rotation.from_matrix(worlds[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
    scales = poses.scales
    if scales is not None:
        scales = scales * np.exp(growths[0] + blend * (growths[1] - growths[0]))
    return Poses(worlds[:, :3, 3], quaternions, scales)


def _nearest(path: Path, key: Poses) -> float:
    """How far along the path the pose is that is nearest to a key, a radian being as far as a unit of length."""

    def distance(share: float) -> float:
        at = path.poses(np.array((share,)))
        off = _logarithm(np.linalg.inv(_matrices(at)[0]) @ _matrices(key)[0])
        growth = 0.0 if key.scales is None else np.log(key.scales[0] / at.scales[0])
        return off @ off + growth**2

    grid = np.linspace(-0.25, 1.25, 49)
    best = grid[np.argmin([distance(share) for share in grid])]
    bounds = best - 1.0 / 32.0, best + 1.0 / 32.0
    return float(minimize_scalar(distance, bounds=bounds, method="bounded", options={"xatol": 1e-10}).x)


def _matrices(poses: Poses) -> np.ndarray:
    """Of the rigid motions alone, shape (n, 4, 4)."""
    made = np.tile(np.eye(4), (len(poses.positions), 1, 1))
    made[:, :3, :3] = Rotation.from_quat(poses.quaternions[:, [1, 2, 3, 0]]).as_matrix()
    made[:, :3, 3] = poses.positions
    return made


def _logarithm(motion: np.ndarray) -> np.ndarray:
    """The twist (6,) of a motion (4, 4)."""
    turn = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
    return np.concatenate((turn, np.linalg.solve(_jacobian(turn), motion[:3, 3])))


def _exponential(twist: np.ndarray) -> np.ndarray:
    """The motion (4, 4) of a twist (6,)."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(twist[:3]).as_matrix()
    motion[:3, 3] = _jacobian(twist[:3]) @ twist[3:]
    return motion


def _jacobian(turn: np.ndarray) -> np.ndarray:
    """What a velocity along the body's axes adds up to while the body turns: the left Jacobian of rotations."""
    angle = np.linalg.norm(turn)
    x, y, z = turn
    crossed = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    if angle < 1e-4:
        return np.eye(3) + 0.5 * crossed + crossed @ crossed / 6.0
    return (
        np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * crossed + (angle - np.sin(angle)) / angle**3 * crossed @ crossed
    )
