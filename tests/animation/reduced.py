"""Motions with a pose on every frame, and how far fewer keys are off."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from rigid_motion.animation import bake_poses, read_poses
from rigid_motion.motion import Poses, interpolate, repair, shell_error
from rigid_motion_batch.recordings import read_trajectories
from tests.animation.keyed import curves_of
from tests.animation.scenes import new_object

ASSETS = Path(__file__).resolve().parents[2] / "assets"
RADIUS = 0.1
TOLERANCE = 0.005


def motion(name: str = "reach", rate: float = 30.0) -> tuple[np.ndarray, Poses]:
    """One of the clips in assets/, imported with a pose on every frame."""
    trajectory = read_trajectories(str(ASSETS / f"{name}.csv")).trajectories[0]
    times, poses, _ = repair(trajectory.times, trajectory.poses)
    frames = np.arange(np.floor((times[-1] - times[0]) * rate) + 1.0)
    return 1.0 + frames, interpolate(times - times[0], poses, frames / rate, "lerp_slerp")


def recorded(name: str = "reach", rotation_mode: str = "QUATERNION", obj: bpy.types.Object | None = None):
    """An object that moves as recorded."""
    obj = obj or new_object(rotation_mode=rotation_mode)
    bake_poses(obj, *motion(name))
    return obj


def off(obj: bpy.types.Object, frames: np.ndarray, truth: Poses, radius: float = RADIUS) -> float:
    """The largest shell error of what Blender shows on these frames."""
    return float(shell_error(read_poses(obj, frames), truth, radius).max())


def keys_of(obj: bpy.types.Object, path: str, index: int = 0) -> list[float]:
    return [point.co.x for point in curves_of(obj)[path, index].keyframe_points]
