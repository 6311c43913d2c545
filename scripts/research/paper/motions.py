"""Clips for the paper's table: those in assets/, and other recordings, except those of a body at rest.

Times are in seconds, lengths in metres. Errors do not depend on the axes, so recordings are used as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from research.making.motions import MOTIONS
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.places import ASSETS, from_here
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip

MAX_REST_RMS = 0.01
"""A body is at rest if its RMS distance from its mean pose is below this, in metres: less than the tremor of a hand."""

Read = TypeVar("Read")


def assets() -> dict[str, Clip]:
    """Read the motions of single bodies in assets/, by name."""
    return {name: read_motion(from_here(ASSETS) / f"{name}.csv") for name in sorted(MOTIONS)}


def read_all(paths: Iterable[Path], read: Callable[[Path], Read]) -> tuple[list[Read], dict[str, str]]:
    """Return the results of reading all files, and for each file that cannot be read, the reason."""
    result, left_out = [], {}
    for path in paths:
        try:
            result.append(read(path))
        except TrajectoryError as error:
            left_out[path.stem] = error.problem
    return result, left_out


def read_motion(path: Path) -> Clip:
    """Read and repair the first body of a recording.

    A whole skeleton is represented by its first joint, a root: the paper's bodies are rigid.

    Raises
    ------
    TrajectoryError
        If it cannot be read, or is at rest.
    """
    clip = replace(read_clips([str(path)], "blender")[0][0], name=path.stem)
    if clip.rest_body:
        clip = replace(clip, poses=clip.poses[0], rest_body=None)
    moved = spread(clip.in_metres(clip.poses))
    if moved < MAX_REST_RMS:
        raise TrajectoryError(path, f"at rest: it stays within {moved * 1e3:.1f} mm of its mean pose", "leave it out")
    return clip


def spread(poses: Poses, radius: float = 0.1) -> float:
    """Return the largest RMS distance of any shell point from its mean."""
    points = poses.positions + rotate(poses.quaternions, radius * np.eye(3)[:, None])
    offsets = points - points.mean(axis=1, keepdims=True)
    return float(np.sqrt(np.square(offsets).sum(axis=-1).mean(axis=1).max()))
