"""Streaming: `rigid_motion.streams` over a transport, and what it costs.

rooms       who is where, by Zenoh
sending     recordings into a room
receiving   what a room shows, and what is handed on to Blender
packed      what else one would send: floats, and the smallest three components, at even rates
measuring   a recording sent to another process in real time, and what was shown there
vmc         performers of other programs, in and out
written     what was shown, as CSV, BVH or TUM
"""
