"""Holding objects in holders with Blender's constraints, whose influences follow the keys.

A *Child Of* constraint to each holder puts the channels in its space, without an inverse and without its scale. An
*Action* constraint to each holder shows, while an object passes to it, the pose in which the object arrives there. Both
have no effect by themselves: their influences are keyed from the holds of the transform's keys, see `actions.marks`.

dependencies  whether a holder depends on the object it is about to hold
placing       poses in the world and in channel spaces, and the components that produce them
holders       the constraints and their targets
keying        from a source to the keys of influences; NumPy alone
problems      why an object is not held as its keys say
apply         writing constraints and influences where they differ

Each module imports only those above it.
"""
