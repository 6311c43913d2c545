"""What Blender's glTF exporter is to leave out: it writes a clip for every Action and slot that could move a rig.

The exporter asks add-ons by its *user extensions*, and lists Actions by the identity of their Python objects.
"""

from __future__ import annotations

from typing import Any

import bpy


class LeaveOut:
    """A user extension of the exporter: clips of what an animator has made, and no others."""

    def gather_actions_hook(self, blender_object: bpy.types.Object, actions: Any, export_settings: Any) -> None:
        """Remove slots of differences, and the Actions from before keys were baked or reduced."""
        kept = _kept_originals(blender_object)
        for identity, listed in list(actions.actions.items()):
            for entry in list(listed):
                differences = {pair.differences for pair in entry.action.rigid_motion.bone_slots}
                entry.slots[:] = [slot for slot in entry.slots if slot.slot.handle not in differences]
                if not entry.slots or entry.action in kept:
                    listed.remove(entry)
            if not listed:
                del actions.actions[identity]


def _kept_originals(obj: bpy.types.Object) -> set[bpy.types.Action]:
    """Return the Actions that are in the file for Un-Bake and Restore Keys alone."""
    bones = obj.pose.bones if obj.pose is not None else ()
    kept = {entry.original for item in (obj, *bones) for entry in item.rigid_motion.bakes} - {None}
    data = obj.animation_data
    if data is not None:
        kept -= {data.action, *(strip.action for track in data.nla_tracks for strip in track.strips)}
    return kept
