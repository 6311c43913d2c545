"""Read-only queries of motions, for the user interface and scripts.

keyed         keys in the slot that the editors show, and their modes
segments      facts about one segment, and problems of modes and holds
polls         checks of many transforms on every redraw

Each module imports only those above it.
"""
