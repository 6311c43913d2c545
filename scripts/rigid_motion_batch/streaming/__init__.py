"""Streaming: `rigid_motion.streams` over a transport, and what it costs.

rooms       who is where, by Zenoh
sending     recordings into a room
receiving   what a room shows, and what is handed on to Blender
measuring   a recording sent to another process, what was shown there, and what even streams of joints cost
vmc         performers of other programs, in and out
written     what was shown, as CSV, BVH or TUM
"""
