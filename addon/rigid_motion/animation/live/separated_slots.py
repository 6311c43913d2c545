"""Rigs that Blender's *Separate Slots* has left with their differences in place of their keys.

It puts each slot into an Action of its own, and gives that to all users of the slot. For Blender a rig uses two slots:
the one of its keys, and by its constraints the one of its differences. That comes later, so the rig ends up with it, by
itself and in strips.
Nothing in the new Actions says which of them were one, but for what is in them, and the names of their slots.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..actions.slots import Slot, is_time, strips_of, uses_of
from ..transforms import bone_name, shows_differences, split_path

SlotNames = dict[int, set[str]]
"""The names of the slots that have the keys of each rig, as last seen, by the rig's session id."""


def notice_slots(slots: Iterable[Slot], names: SlotNames) -> None:
    """Put into `names` by which slots rigs are keyed that have differences in others."""
    for slot in slots:
        if any(pair.handle == slot.handle for pair in slot.action.rigid_motion.bone_slots):
            for user in slot.users:
                names[user.session_uid] = _names_of(user)


def _names_of(rig: bpy.types.Object) -> set[str]:
    """Return the names of the slots that a rig moves by and that have differences in others."""
    keyed = {(action, handle) for action, handle, _ in uses_of(rig).values()}
    return {
        slot.identifier
        for action in {action for action, _ in keyed}
        for pair in action.rigid_motion.bone_slots
        for slot in action.slots
        if slot.handle == pair.handle and (action, slot.handle) in keyed
    }


def are_separated(actions: Iterable[bpy.types.Action]) -> bool:
    """Return whether one of these is what a rig was left with."""
    return any(_rigs_left_with(action) for action in actions)


def give_keys_back(actions: Iterable[bpy.types.Action], names: SlotNames) -> set[bpy.types.Action]:
    """Give rigs the Actions of their keys again that were left with one of these; which ones, is returned."""
    left = {action: _rigs_left_with(action) for action in actions}
    return {action for action, rigs in left.items() for rig in rigs if _has_keys_back(rig, action, names)}


def discard(actions: Iterable[bpy.types.Action]) -> None:
    """Delete those of these Actions that nothing uses any more."""
    for action, users in bpy.data.user_map(subset=set(actions)).items():
        if not users:
            bpy.data.actions.remove(action)


def _rigs_left_with(action: bpy.types.Action) -> list[bpy.types.Object]:
    """Return the rigs that move by this Action, although constraints of ours show it."""
    if not _has_samples_alone(action):
        return []
    owners = bpy.data.user_map(subset={action}, key_types={"ACTION"}, value_types={"OBJECT"})[action]
    return [rig for rig in owners if rig.is_editable and _moving(rig, action) and _shows(rig, action)]


def _has_samples_alone(action: bpy.types.Action) -> bool:
    channelbag = _only_channelbag(action)
    return channelbag is not None and all(
        len(fcurve.sampled_points) and split_path(fcurve.data_path)[0] for fcurve in channelbag.fcurves
    )


def _only_channelbag(action: bpy.types.Action) -> bpy.types.ActionChannelbag | None:
    """Return what is in an Action of one slot, to which none has the differences."""
    is_single = len(action.slots) == 1 and not action.rigid_motion.bone_slots
    return action_get_channelbag_for_slot(action, action.slots[0]) if is_single else None


def _moving(rig: bpy.types.Object, action: bpy.types.Action) -> list[bpy.types.AnimData | bpy.types.NlaStrip]:
    """Return by what of its animation a rig moves by an Action: it itself, and strips."""
    data = rig.animation_data
    return [] if data is None else [user for user in (data, *strips_of(rig)) if user.action == action]


def _shows(rig: bpy.types.Object, action: bpy.types.Action) -> bool:
    bones = () if rig.pose is None else rig.pose.bones
    return any(
        shows_differences(constraint) and constraint.action == action
        for bone in bones
        for constraint in bone.constraints
    )


def _has_keys_back(rig: bpy.types.Object, differences: bpy.types.Action, names: SlotNames) -> bool:
    """Give a rig its keys again, unless it cannot be told where they are."""
    bones = _bones_of(_only_channelbag(differences).fcurves)
    timed = [action for action in bpy.data.actions if bones <= _timed_bones(action)]
    named = [action for action in timed if action.slots[0].identifier in names.get(rig.session_uid, ())]
    if len(result := named or timed) != 1:
        return False
    for user in _moving(rig, differences):
        user.action = result[0]
        user.action_slot = result[0].slots[0]
    return True


def _timed_bones(action: bpy.types.Action) -> set[str]:
    """Return the bones that an Action of one slot has times of differences for."""
    channelbag = _only_channelbag(action) if action.is_editable else None
    return _bones_of(filter(is_time, channelbag.fcurves)) if channelbag is not None else set()


def _bones_of(fcurves: Iterable[bpy.types.FCurve]) -> set[str]:
    return {bone_name(split_path(fcurve.data_path)[0]) for fcurve in fcurves}
