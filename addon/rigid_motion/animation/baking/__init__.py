"""Other keys for the same motion, and the way back.

copies          Actions that were given other keys, and what they are copies of
sizes           how large what is moved is, for tolerances
rigs            all bones of a rig whose Action was copied
originals       what there was before keys were baked or reduced
bake            real keys for every frame
channel_maps    what channels do to space, frame by frame
followers       bones that follow a constraint or a driver, about which nothing is promised
rig_motion      how all bones of a rig move with any keys, and how far off that is
fewer_keys      the few keys that a transform needs
fewer_rig_keys  those of all bones of a rig together
reducing        the few keys that a recording needs, and the way back

Each module imports only those above it.
"""
