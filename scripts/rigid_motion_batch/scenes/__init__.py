"""Scenes and films that show reconstructions: each mode moves side by side with the recording. Needs Blender."""
