"""From what is keyed to the values that channels are to have for the modes: NumPy alone.

components      the rows of arrays: location, rotation, scale; and the numbers of modes
marks           what keys say beyond their values: modes and axes from frames on, and whether anything changes
runs            stretches of keys that are held in the same, and where things pass from one holder to the next
sources         what is keyed, as arrays with a digest, the segments between keys, and whether rounds of them repeat
source_cache    the sources of earlier edits
bodies          the channels' own values, progress in a segment, and poses of a body
turning         whole turns, of angles or of the channel
breakdowns      keys that lie on a path instead of shaping it
ends            the poses that segments run between, the keys beside them, and what modes make of them
channel_values  from poses back to quaternions, Euler angles, or an angle about an axis
differences     from sources to what is to be added to their channels
spans           the stretches of time in which that is smooth

Each module imports only those above it.
"""
