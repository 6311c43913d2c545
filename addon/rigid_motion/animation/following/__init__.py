"""Following edits: in-betweens are updated as soon as keys are inserted, moved, pasted or deleted.

kept_timing    handles that keep the motion unchanged next to an inserted key
kept_runs      the same for held objects, in their holder and after the last key there
shared_turns   turns of segments that are divided by keys
inserted       keys inserted on in-betweens: keys in the other channels, and the motion around them
unkeyed        poses without keys, which are restored after something was written
changes        edits reported by Blender, and the channels that they affect
assigned       world poses assigned to held objects
refreshing     from keys to the terms in their channels
follower       the handlers

Each module imports only those above it.
"""
