"""Keeping in-betweens up to date with every edit in the file that is open.

graphs         which data-blocks were edited, by Blender's dependency graphs
concerned      which objects have to do with modes
glances        which bones an edit was about
insertion      a key inserted in between keeps the pose on the screen
densification  keys inserted all along keep the motion
separated      what Separate Slots does to rigs
edit_mode      rigs in Edit Mode
live           Blender's handlers, and the refresh after every edit

Each module imports only those above it.
"""
