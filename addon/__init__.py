"""Rigid Motion: in-betweens that move an object as one rigid body.

`motion` is the mathematics, in NumPy alone; `animation` is Blender's data. Imports go down only: `animation` knows
`motion`, and `motion` knows neither.
"""
