"""Generated clips with known results, and the throw of the assets."""

from functools import cache

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip


def clip(name: str, times: np.ndarray, positions: np.ndarray, angles: np.ndarray) -> Clip:
    """Return a body at these positions (n, 3), rotated about z by these angles (n,)."""
    zero = np.zeros_like(angles)
    quaternions = np.stack((np.cos(angles / 2.0), zero, zero, np.sin(angles / 2.0)), axis=-1)
    return Clip(name, f"{name}.csv", "blender", times, Poses(positions, quaternions), ())


def circling(turns: float, *, rate: float, seconds: float = 4.0) -> Clip:
    """Return a body circling at 30 cm, 0.4 times per second; it rotates `turns` times as fast: 1 is a pivot."""
    times = np.arange(round(rate * seconds) + 1) / rate
    angles = 2.0 * np.pi * 0.4 * times
    positions = 0.3 * np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
    return clip("circling", times, positions, turns * angles)


@cache
def thrown() -> Clip:
    """Return a drill that is thrown and caught."""
    (clip,), _ = read_clips([str(ASSETS / "throw.csv")], "blender")
    return clip
