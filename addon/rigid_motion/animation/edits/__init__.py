"""What can be done to motions by hand or by script: the verbs behind operators, for many targets at once.

apply        targets, refusals and one refresh for every verb
mode_keys    choosing modes and turns, and Cycles
breakdowns   poses in between, keyed where the playhead is

Each module imports only those above it.
"""
