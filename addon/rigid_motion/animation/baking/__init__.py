"""Other keys for the same motion, and the way back.

originals      what there was before keys were baked, reduced or cleaned
motions        how objects and bones move with any keys, and how far off that is
worlds         where things are in the world, frame by frame
bake           real keys for every frame
resting        where a body is at rest in something
fewer_keys     sources with fewer keys
native_curves  fewer Bezier keys, and their handles
search         the few keys that an object, or the bones of a rig together, need
held_keys      fewer keys of what is held, run by run
kept_keys      keys that stay on their frames, and more where these are not enough
reducing       the few keys that a recording needs, and the way back
cleaning       dense keys without their trembling
layers         an offset on top of a motion
merging_layers both as keys again
into_holds     dense keys in the world to few in the hands that held something

Each module imports only those above it.
"""
