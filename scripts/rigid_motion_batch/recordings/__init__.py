"""Reading recorded trajectories of rigid bodies, from whatever a tracker, a game or Blender wrote.

Everything is returned as it was recorded: the file's own axes, units and signs, with nothing repaired.
`rigid_motion_batch.axes` turns poses to Blender's axes.
"""

from .options import ReadingOptions
from .reading import files_of, read_trajectories
from .recordings import Recording, Trajectory, TrajectoryError

__all__ = ["ReadingOptions", "Recording", "Trajectory", "TrajectoryError", "files_of", "read_trajectories"]
