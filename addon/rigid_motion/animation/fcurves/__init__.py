"""F-curves in NumPy alone: what `FCurve.evaluate` returns, for many curves and many frames at once.

solvers     Bezier segments as cubics, their roots, and handles that run through given values
keys        F-curves as arrays, their segments as cubics, and frames folded back by Cycles modifiers
easings     Robert Penner's equations, as Blender has them
evaluation  the values of curves on frames

Each module imports only those above it.

The rules are those of Blender's own evaluation (source/blender/blenkernel/intern/fcurve.cc, fmodifier.cc), and the
tests compare with it. Blender's own takes one call from Python for each value, or a copy of the Action whose keys it
replaces by samples on whole frames, on every edit.
"""
