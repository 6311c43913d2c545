"""Copies of Actions that are given other keys, and the notes on what is moved that say what each is a copy of."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import Slot, SlotTransform, places_of, transforms_in
from ..transforms import Transform, is_ours, transform_of

BAKED, REDUCED = "BAKED", "REDUCED"
"""What was done to the keys."""


def copied(slot: Slot, kind: str) -> bpy.types.Action:
    """A copy of an Action with one slot, to be given other keys in a way, `BAKED` or `REDUCED`."""
    changed = slot.action.copy()
    name = re.sub(rf" {kind.title()}(\.\d+)?$", "", slot.action.name)
    changed.name = f"{name} {kind.title()}"
    kept = {slot.handle, *(pair.differences for pair in changed.rigid_motion.bone_slots if pair.handle == slot.handle)}
    for other in [other for other in changed.slots if other.handle not in kept]:
        changed.slots.remove(other)
    return changed


def note(transform: Transform, kind: str, changed: bpy.types.Action, original: bpy.types.Action) -> None:
    """Note on something that it was given other keys in an Action, and which one has those from before."""
    entry = transform.motion.bakes.add()
    entry.kind, entry.changed, entry.original = kind, changed, original
    entry.components = transform.components()


def let_rest(
    transform: Transform, entry: bpy.types.PropertyGroup, changed: SlotTransform, original: SlotTransform
) -> None:
    """Give properties that got keys only with a copy the values that they had before."""
    if not entry.is_property_set("components"):
        # From a version that did not note them.
        return
    for row, (path, index) in transform.channels.items():
        before = original.curves.get((path, index))
        if (path, index) in changed.curves and (before is None or before.mute):
            getattr(transform.carrier, path.removeprefix(transform.prefix))[index] = entry.components[row]


def in_action(action: bpy.types.Action, place: SlotTransform) -> SlotTransform:
    """The same transform in the slot of the same name in another Action."""
    name = next(slot.identifier for slot in place.slot.action.slots if slot.handle == place.slot.handle)
    slot = Slot(action, action.slots[name].handle, place.slot.users, place.slot.strips)
    return transforms_in(slot, (place.prefix,))[0]


def exchange(obj: bpy.types.Object, old: bpy.types.Action, new: bpy.types.Action) -> None:
    """Let an object move by another Action, with the slot of the same name in it."""
    data = obj.animation_data
    strips = [strip for track in data.nla_tracks for strip in track.strips]
    for user in (data, *strips):
        if user.action == old:
            name = user.action_slot.identifier
            user.action = new
            user.action_slot = new.slots[name]
    for bone in obj.pose.bones if obj.pose is not None else ():
        for constraint in filter(is_ours, bone.constraints):
            if constraint.action == old and constraint.action_slot is not None:
                name = constraint.action_slot.identifier
                constraint.action = new
                constraint.action_slot = new.slots.get(name)


def entries_of(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, list[bpy.types.PropertyGroup]]]:
    """What has such notes, and those in use: there is one look at what moves a data-block."""
    places: dict[bpy.types.Object, list[SlotTransform]] = {}
    for transform in transforms:
        if len(transform.motion.bakes):
            animated = transform.animated
            if animated not in places:
                places[animated] = places_of(transform_of(animated))
            yield transform, list(entries_in_use(transform, places[animated]))


def entries_in_use(
    transform: Transform, places: Iterable[SlotTransform] | None = None
) -> Iterator[bpy.types.PropertyGroup]:
    """The notes on copies that something moves by, the latest first. `places` move it, where that is known already."""
    bakes = transform.motion.bakes
    if len(bakes):
        places = places_of(transform) if places is None else places
        actions = {place.slot.action for place in places}
        yield from (entry for entry in reversed(bakes) if entry.changed in actions)
