"""F-curves in NumPy alone: what `FCurve.evaluate` returns, for many curves and many frames at once.

keys        F-curves as arrays, and frames folded back by Cycles modifiers
easings     Robert Penner's equations, as Blender has them
solvers     Bezier segments as cubics, their roots, and handles that run through given values
spans       what the value is from each key to the next
evaluation  the values of curves on frames

Each module imports only those above it.

The rules are those of Blender's own evaluation (source/blender/blenkernel/intern/fcurve.cc, fmodifier.cc), and the
tests compare with it. It is written again because Blender offers its own in two forms, and neither will do:

- `FCurve.evaluate` takes one call from Python for each value.
- `FCurve.convert_to_samples` takes whole frames only, and puts samples in place of the keys: it needs a copy of each
  Action. How much of its chord an object has covered is worked out from channels at many sub-frames, on every edit,
  and the animator's curves must not be touched for that.

For 100 objects of 7 channels with 10 Bezier keys each, on 1000 frames (Blender 5.2.3, two cores): 285 ms by `evaluate`,
31 ms by `convert_to_samples` on copies, and 9 ms here, reading the keys (`actions.channels`) included.
"""
