"""From a reconstruction to a film: the scene in which the modes move beside the recording. Needs Blender."""
