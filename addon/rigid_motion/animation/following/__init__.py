"""Following edits: what is keyed anew, moved, pasted or deleted has its in-betweens at once.

kept_timing    handles with which a motion goes on as it did beside a key that was inserted
kept_runs      the same of what is held, in its holder and behind its last key there
shared_turns   turns of segments that keys divide
inserted       keys that were inserted on in-betweens: their fellow channels, and the motion beside them
unkeyed        poses without keys, which are set again once something was written
changes        what Blender tells of edits, and which channels they were about
assigned       poses of the world that are assigned to held things
refreshing     from what is keyed to the terms in its channels
follower       the handlers

Each module imports only those above it.
"""
