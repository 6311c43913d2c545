"""Copies of Actions that are given other keys, and the notes on what is moved that say what each is a copy of."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import Binding, Slot, bindings_in_slot, bindings_with, counterpart_in, strips_of, uses_of
from ..transforms import Transform, shows_differences

BAKED, REDUCED = "BAKED", "REDUCED"
"""The change that was made to the keys."""


def copied(slot: Slot, kind: str) -> bpy.types.Action:
    """Return a copy of an Action with one slot, to be given other keys in a way, `BAKED` or `REDUCED`."""
    changed = slot.action.copy()
    name = re.sub(rf" {kind.title()}(\.\d+)?$", "", slot.action.name)
    changed.name = f"{name} {kind.title()}"
    kept = {slot.handle, *(pair.differences for pair in changed.rigid_motion.bone_slots if pair.handle == slot.handle)}
    for other in [other for other in changed.slots if other.handle not in kept]:
        changed.slots.remove(other)
    for notes in (changed.rigid_motion.slots, changed.rigid_motion.bone_slots):
        for number in [number for number, one in enumerate(notes) if one.handle != slot.handle][::-1]:
            notes.remove(number)
    return changed


def note(transform: Transform, kind: str, changed: bpy.types.Action, original: bpy.types.Action) -> None:
    """Note on something that it was given other keys in an Action, and which one has those from before."""
    entry = transform.motion.bakes.add()
    entry.kind, entry.changed, entry.original = kind, changed, original
    entry.components = transform.components()


def let_rest(transform: Transform, entry: bpy.types.PropertyGroup, changed: Binding, original: Binding) -> None:
    """Give properties that got keys only with a copy the values that they had before."""
    if not entry.is_property_set("components"):
        # From a version that did not note them.
        return
    for row, (path, index) in transform.channels.items():
        before = original.curves.get((path, index))
        if (path, index) in changed.curves and (before is None or before.mute):
            getattr(transform.carrier, path.removeprefix(transform.prefix))[index] = entry.components[row]


def used_in(animated: bpy.types.Object, action: bpy.types.Action | None) -> Slot | None:
    """Return the slot of an Action that something moves by, as if nothing else used it."""
    uses = uses_of(animated).values()
    return next((Slot(action, handle, (animated,), frozenset(at)) for used, handle, at in uses if used == action), None)


def in_copy(transform: Transform, binding: Binding, changed: bpy.types.Action) -> Binding:
    """Return something in the copy that it moves by, which has the same channels as the original."""
    slot = used_in(transform.animated, changed)
    channelbag = slot.channelbag
    result = {channel: channelbag.fcurves.find(channel[0], index=channel[1]) for channel in binding.curves}
    curves = {channel: fcurve for channel, fcurve in result.items() if fcurve is not None}
    return bindings_with(slot, channelbag, {binding.prefix: curves})[0]


class Lookup:
    """The same transforms in one slot and another: each slot is looked through once."""

    def __init__(self, transforms: Iterable[Transform]) -> None:
        self._prefixes = {transform.prefix for transform in transforms}
        self._found: dict[tuple, dict[str, Binding]] = {}

    def find(self, slot: Slot, prefix: str) -> Binding:
        key = slot.action.session_uid, slot.handle, slot.users
        if key not in self._found:
            self._found[key] = {binding.prefix: binding for binding in bindings_in_slot(slot, self._prefixes)}
        return self._found[key][prefix]


def exchange(obj: bpy.types.Object, old: Slot, new: bpy.types.Action) -> None:
    """Let an object move by the same slot in another Action, wherever it moves by this one."""
    shown_by = [(obj.animation_data, old.handle)]
    shown_by += [(strip, old.handle) for strip in strips_of(obj)]
    differences = {pair.handle: pair.differences for pair in old.action.rigid_motion.bone_slots}.get(old.handle)
    for bone in obj.pose.bones if obj.pose is not None else ():
        shown_by += [(constraint, differences) for constraint in filter(shows_differences, bone.constraints)]
    for user, handle in shown_by:
        slot = user.action_slot
        if user.action == old.action and slot is not None and slot.handle == handle:
            same = counterpart_in(new, slot)
            user.action = new
            user.action_slot = same


def entries_of(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, list[bpy.types.PropertyGroup]]]:
    """Yield what has such notes, and those of them in use."""
    for transform in transforms:
        if len(transform.motion.bakes):
            yield transform, list(entries_in_use(transform))


def entries_in_use(transform: Transform) -> Iterator[bpy.types.PropertyGroup]:
    """Yield the notes on copies that something moves by, the latest first."""
    bakes = transform.motion.bakes
    if len(bakes):
        actions = {action for action, *_ in uses_of(transform.animated).values()}
        yield from (entry for entry in reversed(bakes) if entry.changed in actions)
