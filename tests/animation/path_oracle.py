"""Where breakdowns lie beside the path of a mode, and how that is made up for, worked out apart from the program."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from rigid_motion.motion import Poses, twists
from rigid_motion.motion.quaternions import multiply, rotate

if TYPE_CHECKING:
    from tests.animation.body_oracle import Path


DEPENDS_ON_KEYS = {"pga_lerp", "cga_lerp", "motor_spline"}
"""Another key on the path of one of these would make another path of it."""


def lies_on_path(curves: list[bpy.types.FCurve], frame: float, mode: str) -> bool:
    """Whether a key between others is a breakdown in all channels that have one there, where that matters."""
    types = {key.type for curve in curves for key in curve.keyframe_points if key.co[0] == frame}
    repeats = any(modifier.type == "CYCLES" and not modifier.mute for curve in curves for modifier in curve.modifiers)
    return mode in DEPENDS_ON_KEYS and not repeats and types == {"BREAKDOWN"}


def beside_path(path: Path, frames: np.ndarray, share: np.ndarray) -> Poses:
    """The poses between two keys (2,) of which at least one is a breakdown: along the path, and as far off as they."""
    places, offs = _beside(path, frames)
    (first, second), growths = offs[:, :6], offs[:, 6]
    poses = path.poses(places[0] + (places[1] - places[0]) * share)
    blend = np.clip(share, 0.0, 1.0)
    if path.mode == "motor_spline":
        blend = blend * blend * (3.0 - 2.0 * blend)
    begin, end = _moved(first[:, None]), _moved(second[:, None])
    change = twists.between(begin.positions, begin.quaternions, end.positions, end.quaternions)
    begin = begin[np.zeros(len(share), dtype=int)]
    poses = _after(_after(poses, begin), _moved(change * blend))
    if poses.scales is not None:
        poses = replace(poses, scales=poses.scales * np.exp(growths[0] + blend * (growths[1] - growths[0])))
    return poses


def goes_beside(path: Path, frames: np.ndarray) -> bool:
    """Whether any of these keys (2,) is off the path, and not by rounding alone."""
    return bool(np.abs(_beside(path, frames)[1]).max() > 1e-4)


def _beside(path: Path, frames: np.ndarray) -> tuple[list[float], np.ndarray]:
    """How far along the path the poses are that are nearest to keys (2,), and how far these are off it, (2, 7)."""
    places = []
    for frame in frames[:, None]:
        along = path.shared_with_key(frame[0])
        places.append(_nearest(along, along.body.key_poses(frame)))
    return places, _off(path.poses(np.array(places)), path.body.key_poses(frames))


def _nearest(path: Path, key: Poses) -> float:
    """How far along the path the pose is that is nearest to a key, a radian being as far as a unit of length."""

    def distances(shares: np.ndarray) -> np.ndarray:
        return (_off(path.poses(shares), key[np.zeros(len(shares), dtype=int)]) ** 2).sum(axis=1)

    grid = np.linspace(-0.25, 1.25, 49)
    best = grid[np.argmin(distances(grid))]
    low, high = best - 1.0 / 32.0, best + 1.0 / 32.0
    for _ in range(40):
        # By the golden section.
        first, second = high - (high - low) / 1.618034, low + (high - low) / 1.618034
        of_first, of_second = distances(np.array((first, second)))
        low, high = (low, second) if of_first < of_second else (first, high)
    return 0.5 * (low + high)


def _off(poses: Poses, keys: Poses) -> np.ndarray:
    """The twists from poses (n,) to keys, with the growth of log scale, shape (n, 7)."""
    result = twists.between(poses.positions, poses.quaternions, keys.positions, keys.quaternions)
    growths = np.zeros(len(keys.positions)) if keys.scales is None else np.log(keys.scales / poses.scales)
    return np.vstack((result, growths)).T


def _moved(rows: np.ndarray) -> Poses:
    quaternions, translations = twists.exponential(rows)
    return Poses(translations.T, quaternions.T)


def _after(poses: Poses, moves: Poses) -> Poses:
    """Poses after moves along the body's own axes."""
    positions = poses.positions + rotate(poses.quaternions, moves.positions)
    return Poses(positions, multiply(poses.quaternions, moves.quaternions), poses.scales)
