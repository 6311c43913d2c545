"""Bodies live: `rigid_motion.streams` over a transport, and what it costs.

transports  what carries datagrams: two methods, and UDP on this machine
packed      what else one would send: floats, and the smallest three components, at even rates
measuring   a recording sent to another process in real time, and what was shown there
written     what was shown, as BVH or CSV
vmc         performers of other programs, in and out
"""
