"""From what is keyed to the differences between Blender's in-betweens and those of the modes: NumPy alone.

components    the rows of arrays: location, rotation, scale; and the numbers of modes
sources       what is keyed, as arrays with a digest
source_cache  the sources of earlier edits
bodies        the channels' own values, progress in a segment, poses of a body, and back to differences
turning       whole turns, of Euler angles or of the channel
samples       which differences vary from frame to frame, and how far off a motion is between samples
breakdowns    keys that lie on a path instead of shaping it
ends          the poses that segments run between, the keys beside them, and what modes make of them
differences   from sources to differences
sample_rates  how many samples a frame a motion needs

Each module imports only those above it.
"""
