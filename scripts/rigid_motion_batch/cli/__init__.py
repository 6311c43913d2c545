"""The commands that users run, and their start."""
