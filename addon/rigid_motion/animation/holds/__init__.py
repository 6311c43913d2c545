"""What something is held in, as Blender plays it: constraints, whose influences follow the keys.

A *Child Of* to each holder has the channels be in its space, without an inverse and without its scale. An *Action*
constraint to each shows, while something passes to it, the pose in which it arrives there. Both are by themselves
nothing: their influences are keyed from what the keys of the transform say, see `actions.marks`.

dependencies  whether a holder follows what it is to hold
placing       where things are, and the components that put them there
holders       the constraints, and what they are to
keying        from a source to the keys of influences; NumPy alone
problems      why something is not held as its keys say
apply         written where they differ

Each module imports only those above it.
"""
