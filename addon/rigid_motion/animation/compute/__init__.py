"""From what is keyed to the differences between Blender's in-betweens and those of the modes: NumPy alone.

components       the rows of arrays: location, rotation, scale
modes            the numbers of modes, and their names
sources          what is keyed, as arrays with a digest
source_cache     the sources of earlier edits, and what has changed since
channel_rows     the channels' own values, of many sources at once
progress         how far a motion has come in a segment
bodies           channels as poses of a body
turning          whole turns, of Euler angles or of the channel
key_speeds       how fast a smooth motion with handles passes its keys
neighbours       the keys beside a segment, for modes that look at them
samples          which differences vary from frame to frame
breakdowns       keys that lie on a path instead of shaping it
ends             the poses that segments run between, and what modes make of them
influences       differences for strips with less than full influence
between_samples  how far off a motion is between samples
differences      from sources to differences
sample_rates     how many samples a frame a motion needs

Each module imports only those above it.
"""
