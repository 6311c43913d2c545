"""From what is keyed to what is different from Blender's in-betweens: arrays alone, nothing is read from Blender.

bodies         channels as poses of a body
differences    from sources to differences
known_sources  the sources of earlier edits, and what has changed since
on_screen      what is seen, as properties

Each module imports only those above it.
"""
