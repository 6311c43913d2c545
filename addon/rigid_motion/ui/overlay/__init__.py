"""The overlay of the 3D viewport: paths of selected objects or bones, Blender's own beside that of a rigid-motion mode.

points   paths, and which ticks can be told apart in a view
seen     where something is on any frames
parents  where parents carry it         kinds    what channels are in
ghosts   poses every few frames         blends   from one place to another
records  where hands were seen          held     where what is held goes
cache    what is worked out already     settings what to show
drawing  lines and dots on the screen
ghost_drawing  ghosts on the screen, around the current frame
ghost_bodies   skinned meshes, as they were seen on other frames
cleaned  what was cleaned, before and after
"""
