"""What `benchmark_live.py` measures.

scenes    files with animated objects, and Blender's own baking of them
turns     the same work by turns, and what is told of the seconds
everyday  edits and playback        shots     modes for many objects at once, edits of all, and the file
rigs      bones                         baking    one object over many frames

Each section is a function that measures and yields lines of Markdown. The extension has to be registered.
"""
