"""Baking, reducing and cleaning keys: other keys for the same motion, and the way back.

originals      the channels from before keys were baked, reduced or cleaned
motions        the motion of objects and bones for given keys, and its error
worlds         world matrices, frame by frame
bake           real keys for every frame
resting        stretches on which a body is at rest relative to another
fewer_keys     sources with fewer keys
native_curves  fewer Bezier keys, and their handles
search         the few keys that an object, or all bones of a rig, need
held_keys      fewer keys for held objects, hold by hold
kept_keys      keys that stay on their frames, and extra keys where these are not enough
reducing       few keys from a recording, and the way back
cleaning       dense keys without jitter
layers         an offset on top of a motion
merging_layers a motion and its offset as one set of keys again
into_holds     dense world-space keys reduced to a few keys in the hands that held a prop

Each module imports only those above it.
"""
