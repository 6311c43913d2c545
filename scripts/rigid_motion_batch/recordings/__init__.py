"""Recorded motions of rigid bodies and whole figures, read from tracker, game and Blender files.

`read_clips` returns repaired motions, `read_trajectories` returns them as recorded. Both keep the axes and units of the
file; `rigid_motion_batch.axes` converts poses to Blender's axes.
"""

from .clip_reading import read_clips
from .clips import Clip, ClipWarning
from .options import ReadingOptions
from .reading import files_of, read_trajectories
from .recordings import Recording, Trajectory, TrajectoryError

__all__ = [
    "Clip",
    "ClipWarning",
    "ReadingOptions",
    "Recording",
    "Trajectory",
    "TrajectoryError",
    "files_of",
    "read_clips",
    "read_trajectories",
]
