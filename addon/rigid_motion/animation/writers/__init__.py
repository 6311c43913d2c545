"""Where differences go: into the delta transforms of objects, or on top of them and of pose bones by a constraint.

sampled           F-curves without keys, and how samples lie in them
corners           keys between samples
deltas            objects, and what every writer does
times             which frame a constraint shows, and how much of it
bone_constraints  constraints on bones, each of which shows a slot, and what may be amiss with them
constraints       pose bones, and objects that are exact between frames
table             what writes the differences of which kind
filling           computing and writing the in-betweens of many; one sample a frame in drafts
channel_values    the values of keys that do without in-betweens

Each module imports only those above it.
"""
