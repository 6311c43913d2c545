"""Edits of motions, by hand or by script: the actions behind operators, for many targets at once.

apply        targets, refusals and one refresh for every edit
mode_keys    choosing modes and turns, and Cycles
breakdowns   in-between poses, keyed at the playhead
path_keys    keys moved in the world, retimed, inserted
speed        even speed along a path, by the timing of keys and handles
holding      the spaces of keys, and passes of objects from hand to hand

Each module imports only those above it.
"""
