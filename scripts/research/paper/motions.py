"""The clips that the table is made from: those in assets/, and the recordings in a folder. Not those of a body at rest.

Times are seconds, lengths metres. Errors do not depend on the axes, so recordings are taken as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.reading import FORMATS

REST = 0.01
"""A body is at rest that stays, by the root mean square, so near to its mean pose: less than a hand trembles."""


RECORDINGS, ASSETS = "recordings", "assets"
"""The sets of clips over which means are taken."""


@dataclass(frozen=True)
class Motion:
    """A clip that was looked at. The fields are the columns of `clips.csv`."""

    clip: str
    source: str
    """The name of its file."""

    of: str
    """`RECORDINGS` or `ASSETS`."""

    samples: int = 0
    seconds: float = 0.0
    samples_per_s: float = 0.0
    """Between gaps."""

    spread_m: float = 0.0
    left_out: str = ""
    """Why it does not count; empty where it does."""


def recordings_in(folder: Path) -> list[Path]:
    """The recordings in a folder, by name: files of any format that is read.

    Raises
    ------
    TrajectoryError
        Where there is no such folder, or no recording in it.
    """
    if not folder.is_dir():
        raise TrajectoryError(str(folder), "no such folder", "check the path")
    extensions = {extension for known in FORMATS for extension in known.extensions}
    found = sorted(path for path in folder.iterdir() if path.is_file() and path.suffix.lower() in extensions)
    if not found:
        raise TrajectoryError(str(folder), "no recording in this folder", f"known are {', '.join(sorted(extensions))}")
    return found


def read_motion(source: str, name: str, of: str) -> tuple[Motion, Clip | None]:
    """Read and repair the first body of a recording; no clip where it cannot be read or does not move.

    A whole skeleton is represented by its first joint, a root: the paper's bodies are rigid.
    """
    file = Path(source).name
    try:
        read = read_clips([source], "blender")[0][0]
    except TrajectoryError as error:
        return Motion(name, file, of, left_out=str(error).replace(source, file)), None
    clip = replace(read, name=name)
    if clip.figure:
        clip = replace(clip, poses=clip.poses[0], figure=None)
    moved = spread(clip.in_metres(clip.poses))
    reason = f"at rest: it stays within {moved * 1e3:.1f} mm of its mean pose" if moved < REST else ""
    seconds = float(clip.times[-1] - clip.times[0])
    motion = Motion(name, file, of, len(clip.times), seconds, sampling_rate(clip), moved, reason)
    return motion, None if reason else clip


def sampling_rate(clip: Clip) -> float:
    """Samples a second, between gaps."""
    return clip.samples_a_second


def spread(poses: Poses, radius: float = 0.1) -> float:
    """How far the points of the shell are from their means, the farthest of them, by the root mean square."""
    arms = radius * np.eye(3)[:, None]
    points = poses.positions + rotate(poses.quaternions, np.broadcast_to(arms, (3, len(poses), 3)))
    offsets = points - points.mean(axis=1, keepdims=True)
    return float(np.sqrt(np.square(offsets).sum(axis=-1).mean(axis=1).max()))
