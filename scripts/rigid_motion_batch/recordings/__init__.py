"""Reading recorded motions of rigid bodies and whole figures, from whatever a tracker, a game or Blender wrote.

`read_clips` gives them repaired, `read_trajectories` as they were recorded. Both keep the file's own axes and units;
`rigid_motion_batch.axes` turns poses to Blender's axes.
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
