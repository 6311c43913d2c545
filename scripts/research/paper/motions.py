"""The clips that the table is made from: those in assets/, and the recordings in a folder. Not those of a body at rest.

Times are seconds, lengths metres. Errors do not depend on the axes, so recordings are taken as they are.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.places import ASSETS, from_here
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.reading import FORMATS

REST = 0.01
"""A body is at rest that stays, by the root mean square, so near to its mean pose: less than a hand trembles."""


def assets() -> list[Clip]:
    """Read the motions in assets/."""
    return [read_motion(path) for path in sorted(from_here(ASSETS).glob("*.csv"))]


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, by name: files of any format that is read.

    Raises
    ------
    TrajectoryError
        Where there is no such folder, or no recording in it.
    """
    if not folder.is_dir():
        raise TrajectoryError(str(folder), "no such folder", "check the path")
    extensions = {extension for known in FORMATS for extension in known.extensions}
    result = sorted(path for path in folder.iterdir() if path.is_file() and path.suffix.lower() in extensions)
    if not result:
        raise TrajectoryError(str(folder), "no recording in this folder", f"known are {', '.join(sorted(extensions))}")
    return result


def read_motion(path: Path) -> Clip:
    """Read and repair the first body of a recording.

    A whole skeleton is represented by its first joint, a root: the paper's bodies are rigid.

    Raises
    ------
    TrajectoryError
        Where it cannot be read, or is at rest.
    """
    clip = replace(read_clips([str(path)], "blender")[0][0], name=path.stem)
    if clip.rest_body:
        clip = replace(clip, poses=clip.poses[0], rest_body=None)
    moved = spread(clip.in_metres(clip.poses))
    if moved < REST:
        raise TrajectoryError(path, f"at rest: it stays within {moved * 1e3:.1f} mm of its mean pose", "leave it out")
    return clip


def spread(poses: Poses, radius: float = 0.1) -> float:
    """Return how far the points of the shell are from their means, the farthest, by the root mean square."""
    arms = radius * np.eye(3)[:, None]
    points = poses.positions + rotate(poses.quaternions, np.broadcast_to(arms, (3, len(poses), 3)))
    offsets = points - points.mean(axis=1, keepdims=True)
    return float(np.sqrt(np.square(offsets).sum(axis=-1).mean(axis=1).max()))
