"""Other keys for the same motion, and the way back.

originals   what there was before keys were baked or reduced
motions     how objects and bones move with any keys, and how far off that is
bake        real keys for every frame
fewer_keys  sources with fewer keys
search      the few keys that an object, or the bones of a rig together, need
reducing    the few keys that a recording needs, and the way back

Each module imports only those above it.
"""
