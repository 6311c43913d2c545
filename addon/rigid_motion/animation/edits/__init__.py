"""What can be done to motions by hand or by script: the verbs behind operators, for many targets at once.

apply        targets, refusals and one refresh for every verb
mode_keys    choosing modes and turns, and Cycles
breakdowns   poses in between, keyed where the playhead is
path_keys    keys moved in the world, retimed, inserted
speed        even speed along a path, by the timing of keys and handles
holding      in which space keys are, and how things pass from hand to hand

Each module imports only those above it.
"""
