"""Motions to send, and how far they get from one frame to the next."""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import angle_between, normalise
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from tests.recordings import RECORDINGS

FRAME = 1.0 / 60.0

SOURCES = sorted(path.name + ":*" * (path.suffix == ".bvh") for path in RECORDINGS.glob("*.*") if path.suffix != ".md")
"""Other people's recordings, with all bodies that are in them."""


def clips(source: str) -> list[Clip]:
    """What is in one of the `SOURCES`."""
    return read_clips([str(RECORDINGS / source)], "blender")[0]


def swinging(seed: int = 0, seconds: float = 3.0) -> tuple[np.ndarray, Poses]:
    """A smooth motion of a few decimetres and half turns, up to twice a second, recorded 90 times a second."""
    random = np.random.default_rng(seed)
    times = np.arange(round(seconds * 90.0) + 1) / 90.0
    frequencies, phases = random.uniform(0.1, 2.0, (7, 4, 1)), random.uniform(0.0, 2.0 * np.pi, (7, 4, 1))
    waves = random.normal(size=(7, 4, 1)) / frequencies * np.sin(2.0 * np.pi * frequencies * times + phases)
    channels = waves.sum(axis=1).T
    return times, Poses(0.2 * channels[:, :3], normalise(channels[:, 3:] + (3.0, 0.0, 0.0, 0.0)))


def steps(poses: Poses) -> np.ndarray:
    """The way and the turn from each of k poses to the next, shape (2, k - 1)."""
    return np.stack(
        (
            np.linalg.norm(np.diff(poses.positions, axis=0), axis=-1),
            angle_between(poses.quaternions[:-1], poses.quaternions[1:]),
        )
    )


def fastest(times: np.ndarray, poses: Poses, frame: float = FRAME) -> np.ndarray:
    """The longest way and the largest turn of a recorded motion within a frame, shape (2,)."""
    return steps(interpolate(times, poses, np.arange(times[0], times[-1], frame))).max(axis=1)
