"""F-curves evaluated with NumPy alone: the results of `FCurve.evaluate`, for many curves and frames at once.

solvers     Bezier segments as cubics, their roots, and handles through given values
keys        F-curves as arrays, their segments as cubics, and frames folded back by Cycles modifiers
easings     Robert Penner's equations in Blender's form
evaluation  the values of curves on frames

Each module imports only those above it.

The rules are those of Blender's own evaluation (source/blender/blenkernel/intern/fcurve.cc, fmodifier.cc), and the
tests compare with it. Blender's own would need one call from Python for each value, or, on every edit, a copy of the
Action with its keys replaced by samples on whole frames.
"""
