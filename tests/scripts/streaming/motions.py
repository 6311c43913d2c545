"""Motions to send."""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise


def swinging(seed: int = 0, seconds: float = 3.0) -> tuple[np.ndarray, Poses]:
    """A smooth motion of a few decimetres and half turns, up to twice a second, recorded 90 times a second."""
    random = np.random.default_rng(seed)
    times = np.arange(round(seconds * 90.0) + 1) / 90.0
    frequencies, phases = random.uniform(0.1, 2.0, (7, 4, 1)), random.uniform(0.0, 2.0 * np.pi, (7, 4, 1))
    waves = random.normal(size=(7, 4, 1)) / frequencies * np.sin(2.0 * np.pi * frequencies * times + phases)
    channels = waves.sum(axis=1).T
    return times, Poses(0.2 * channels[:, :3], normalise(channels[:, 3:] + (3.0, 0.0, 0.0, 0.0)))
