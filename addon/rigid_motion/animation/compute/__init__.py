"""From what is keyed to the differences between Blender's in-betweens and those of the modes: NumPy alone.

components       the rows of arrays: location, rotation, scale
sources          what is keyed, as arrays with a digest
source_cache     the sources of earlier edits, and what has changed since
bodies           channels as poses of a body
key_speeds       how fast a smooth motion with handles passes its keys
neighbours       the keys beside a segment, for modes that look at them
between_samples  how far off a motion is between samples
differences      from sources to differences
sample_rates     how many samples a frame a motion needs

Each module imports only those above it.
"""
