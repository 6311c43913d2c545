"""Rigs: what Edit Mode is spared, and what Blender's *Separate Slots* has left of them.

In Edit Mode their constraints show nothing, for Blender's Symmetrize crashes on what they show. Nothing of it is to be
seen, as Blender shows rigs at rest there. Files are saved with everything in its place. This goes on while edits are
not followed: a crash does not ask for it.

*Separate Slots* puts each slot into an Action of its own, and gives that to all users of the slot. For Blender a rig
uses two slots: the one of its keys, and by its constraints the one of its differences. That comes later, so the rig
ends up with it, by itself and in strips. Nothing in the new Actions says which of them were one, but for what is in
them, and the names of their slots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import bpy
from bpy.app.handlers import persistent
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..actions.records import follow_renamed_in
from ..actions.slots import Slot, is_time, slot_with, slots_alone, strips_of
from ..handlers import append_handlers, remove_handlers
from ..transforms import bone_name, difference_constraints, split_path
from ..writers.bone_constraints import attach_slots, detach_slots

SlotNames = dict[int, set[str]]
"""The names of the slots that have the keys of each rig, as last seen, by the rig's session id."""


def notice_slots(slots: Iterable[Slot], names: SlotNames) -> None:
    """Put into `names` by which slots rigs are keyed that have differences in others."""
    for slot in slots:
        if slot.differences:
            for user in slot.users:
                keyed = (slot for slot in slots_alone(user) if slot.differences)
                names[user.session_uid] = {slot_with(*slot.key).identifier for slot in keyed}


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
    channelbag = _only_channelbag(action)
    if channelbag is None or not all(
        len(fcurve.sampled_points) and split_path(fcurve.data_path)[0] for fcurve in channelbag.fcurves
    ):
        return []
    owners = bpy.data.user_map(subset={action}, key_types={"ACTION"}, value_types={"OBJECT"})[action]
    return [
        rig
        for rig in owners
        if rig.is_editable
        and _moving(rig, action)
        and any(constraint.action == action for constraint in difference_constraints(rig))
    ]


def _only_channelbag(action: bpy.types.Action) -> bpy.types.ActionChannelbag | None:
    """Return what is in an Action of one slot, to which none has the differences."""
    is_single = len(action.slots) == 1 and not action.rigid_motion.bone_slots
    return action_get_channelbag_for_slot(action, action.slots[0]) if is_single else None


def _moving(rig: bpy.types.Object, action: bpy.types.Action) -> list[bpy.types.AnimData | bpy.types.NlaStrip]:
    """Return by what of its animation a rig moves by an Action: it itself, and strips."""
    data = rig.animation_data
    return [] if data is None else [user for user in (data, *strips_of(rig)) if user.action == action]


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


def follow_mode(rig: bpy.types.Object) -> None:
    """Have the constraints of a rig show nothing in Edit Mode, and their slots again outside of it."""
    if rig.mode == "EDIT":
        detach_slots(rig)
        # Most edits find it set, and to set it again would be an edit.
        if not rig.rigid_motion.detached:
            rig.rigid_motion.detached = True
    else:
        _put_back(rig)


def _put_back(rig: bpy.types.Object) -> None:
    if rig.rigid_motion.detached:
        follow_renamed_in(rig)
        attach_slots(rig)
        rig.rigid_motion.detached = False


def _for_rigs(act: Callable[[bpy.types.Object], None], objects: Iterable[bpy.types.Object]) -> None:
    for obj in objects:
        if obj.pose is not None and obj.is_editable:
            act(obj)


@persistent
def _on_update(_: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if depsgraph.id_type_updated("OBJECT"):
        blocks = (update.id for update in depsgraph.updates)
        _for_rigs(follow_mode, (block.original for block in blocks if isinstance(block, bpy.types.Object)))


@persistent
def _on_file(*_: object) -> None:
    _for_rigs(follow_mode, bpy.data.objects)


@persistent
def _before_saving(*_: object) -> None:
    _for_rigs(_put_back, bpy.data.objects)


HANDLERS = {
    "depsgraph_update_post": _on_update,
    "undo_post": _on_file,
    "redo_post": _on_file,
    "load_post": _on_file,
    "save_pre": _before_saving,
    "save_post": _on_file,
    "save_post_fail": _on_file,
}


def register() -> None:
    append_handlers(HANDLERS)


def unregister() -> None:
    remove_handlers(HANDLERS)
    _for_rigs(_put_back, bpy.data.objects)
