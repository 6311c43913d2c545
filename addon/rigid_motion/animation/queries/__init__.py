"""What the user interface and scripts ask of motions. Nothing is changed.

keyed         keys in the slot that the editors show, and their modes
segments      one segment in numbers, and why something does not move as its mode says
polls         what is asked of many at every redraw

Each module imports only those above it.
"""
