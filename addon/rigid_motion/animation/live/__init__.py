"""Following edits: in-betweens are kept up to date with every edit in the file that is open.

edited         which data-blocks were edited, by what operators, and which have to do with modes
snapshots      which bones an edit was about
kept_timing    handles with which the motion goes on beside a key inserted in between
inserted_keys  a key inserted in between keeps the pose on the screen
seen_pose      the pose that is seen in properties: of what nothing animates any more, and for what reads them
dense_keys     keys inserted all along keep the motion
segment_keys   keys of modes and turns, which inserted keys share out
rigs           rigs in Edit Mode, and what Separate Slots does to them
refreshing     what becomes of in-betweens after an edit
follower       Blender's handlers, which find out what was edited

Each module imports only those above it.
"""
