"""Where differences go: into the delta transforms of objects, or on top of them and of pose bones by a constraint.

layout             how samples lie in F-curves
corners            keys between samples
sampled            F-curves without keys
writer             the interface of a writer
deltas             objects
times              which frame a constraint shows, and how much of it
bone_constraints   constraints on bones, each of which shows a slot
constraint_repair  what may be amiss with a constraint
constraints        pose bones, and objects that are exact between frames
table              what writes the differences of which kind
drafts             one sample a frame while an Action is edited
filling            computing and writing the in-betweens of many
channel_values     the values of keys that do without in-betweens

Each module imports only those above it.
"""
