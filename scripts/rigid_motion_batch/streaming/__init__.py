"""Streaming motion over a transport with `rigid_motion.streams`, and measuring its cost.

rooms       knows who is in a room, by Zenoh
sending     sends recordings into a room
receiving   shows the streams of a room, and forwards them to Blender
measuring   sends a recording to another process, and measures bytes and errors
vmc         exchanges performers with other programs
written     writes received motion as CSV or BVH
"""
