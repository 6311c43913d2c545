"""Motion paths in the 3D viewport: paths of selected objects or bones, Blender's own and that of a rigid-motion mode.

points   sampled paths, and which ticks are legible in a view
seen     the motion of an object or bone on any frames
parents  the motion of its parents      kinds    the space of its channels
ghosts   poses every few frames         blends   blending of two transforms
records  places of constrained holders  held     the motion of held objects
cache    paths computed earlier         settings what to show
drawing  lines and dots on the screen
ghost_drawing  ghosts on the screen, around the current frame
ghost_bodies   skinned meshes, recorded on frames that were shown
cleaned  paths before and after Clean Motion
"""
