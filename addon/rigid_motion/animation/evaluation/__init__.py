"""Evaluation of modes: from keyed channels to the channel values that the modes give, with NumPy alone.

components      the rows of arrays (location, rotation, scale), and the numbers of modes
marks           modes, axes and other numbers that keys set from a frame on, and whether curves change
runs            stretches of keys with the same holder, and the switches from one holder to the next
sources         the keyed channels as arrays with a digest, their segments, and whether their cycles repeat
source_cache    the sources of earlier edits
bodies          the channels' own values, progress in a segment, and poses of a body
turning         whole turns between keys, from angles or from the Turns channel
breakdowns      keys that lie on a path instead of shaping it
ends            the poses at the ends of segments, the neighbouring keys, and the poses of each mode
channel_values  from poses back to quaternions, Euler angles, or an angle about an axis
differences     from sources to the values to add to their channels
spans           the stretches of time in which the added values are smooth

Each module imports only those above it.
"""
