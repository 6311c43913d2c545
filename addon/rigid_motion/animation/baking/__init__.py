"""Other keys for the same motion, and the way back.

originals       what there was before keys were baked or reduced
motions         how transforms and rigs move with any keys, and how far off that is
bake            real keys for every frame
fewer_keys      the few keys that a transform needs
proof           whether bones keep to a tolerance, at all moments
fewer_rig_keys  those of all bones of a rig together
reducing        the few keys that a recording needs, and the way back

Each module imports only those above it.
"""
