"""Following edits: in-betweens are kept up to date with every edit in the file that is open.

depsgraphs       which data-blocks were edited, by Blender's dependency graphs
modes_in_use     which objects have to do with modes
raw_keys         the keys of F-curves as bytes, quickly
snapshots        which bones an edit was about
operators        which operators have set properties, or a script
kept_timing      handles with which the motion goes on beside a key inserted in between
inserted_keys    a key inserted in between keeps the pose on the screen
left_in_place    what nothing animates any more stays where it is seen
seen_in_channels  the pose that is seen in the channels, for what of Blender reads these
dense_keys       keys inserted all along keep the motion
segment_keys     keys of modes and turns, which inserted keys share out
separated_slots  what Separate Slots does to rigs
edit_mode        rigs in Edit Mode
between_frames   when drafts have to be finished
refreshing       what becomes of in-betweens after an edit
follower         Blender's handlers, which find out what was edited

Each module imports only those above it.
"""
