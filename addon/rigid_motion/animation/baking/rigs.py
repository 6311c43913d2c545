"""Originals of rigs: one Action moves many bones, and each of them has a way back of its own.

The first bone that is given other keys has its rig move by a copy of the Action. So long as a bone is in that copy as
it is in the original, it can be given others there too; otherwise there is a copy of the copy. On the way back a bone
gets its own channels from its original, and all others stay as they are. The rig goes back to an original once that is
what its Action has come to be again.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ..actions.channels import copy_fcurve, key_fields
from ..actions.key_reading import read_keys
from ..actions.records import record_mode, record_turns_axis, recorded, recorded_mode
from ..actions.renaming import keep_names
from ..actions.slots import Binding, Slot, bindings_in_slot, in_action, slots_of
from ..transforms import SEGMENT_PROPERTIES, WIDTHS, Transform
from .copies import Lookup, copied, exchange, in_copy, let_rest, note, used_in


def move_by_copy(transform: Transform, binding: Binding, kind: str) -> Binding:
    """Let something of a rig be moved by a copy of what moves it, see `originals.move_by_copy`."""
    rig, original = transform.animated, binding.slot.action
    changed = _copy_of(rig, binding.slot)
    if changed is None:
        # Not in this go, but before: it may be in a copy by now itself.
        before = next(iter(_originals_of(rig, original)), None)
        changed = original
        if before is None or _is_shared(rig, binding.slot) or not _is_as_in(before, binding):
            changed = copied(binding.slot, kind)
            exchange(rig, binding.slot, changed)
            _rename_in_notes(rig, original, changed)
            keep_names(rig)
        else:
            original = before
    note(transform, kind, changed, original)
    return in_copy(transform, binding, changed)


def put_back(transform: Transform, kind: str, lookup: Lookup) -> None:
    """Give something of a rig its own channels back, see `originals.put_back`."""
    bakes = transform.motion.bakes
    for number in reversed(range(len(bakes))):
        entry = bakes[number]
        slot = used_in(transform.animated, entry.changed)
        if slot is None or entry.original is None:
            continue
        if entry.kind != kind:
            break
        changed, original = entry.changed, entry.original
        binding, before = (lookup.find(item, transform.prefix) for item in (slot, in_action(original, slot)))
        let_rest(transform, entry, binding, before)
        _copy_channels(before, binding)
        bakes.remove(number)
        _go_back_to(transform.animated, changed, original, slot)


def _copy_of(rig: bpy.types.Object, slot: Slot) -> bpy.types.Action | None:
    """Return the Action that a rig moves by and that has other keys for parts of it,
    which this slot has from before.
    """
    noted = {entry.changed for entry in _entries(rig) if entry.original == slot.action}
    # One that somebody has put the original in place of by hand is not used any more.
    return next((item for item in noted if used_in(rig, item) is not None and in_action(item, slot) is not None), None)


def _originals_of(rig: bpy.types.Object, changed: bpy.types.Action) -> Iterator[bpy.types.Action]:
    return (entry.original for entry in _entries(rig) if entry.changed == changed and entry.original is not None)


def _entries(rig: bpy.types.Object) -> Iterator[bpy.types.PropertyGroup]:
    """Yield the notes on all that there is of a rig."""
    yield from rig.rigid_motion.bakes
    for bone in rig.pose.bones:
        yield from bone.rigid_motion.bakes


def _rename_in_notes(rig: bpy.types.Object, old: bpy.types.Action, new: bpy.types.Action) -> None:
    for entry in _entries(rig):
        if entry.changed == old:
            entry.changed = new


def _is_shared(rig: bpy.types.Object, slot: Slot) -> bool:
    """Return whether something else moves by a slot of a rig as well."""
    return any(
        item.users != (rig,) for item in slots_of([rig]) if (item.action, item.handle) == (slot.action, slot.handle)
    )


def _is_as_in(action: bpy.types.Action, binding: Binding) -> bool:
    """Return whether a transform has the same keys and modes in another Action."""
    slot = in_action(action, binding.slot)
    return slot is not None and _is_as(*bindings_in_slot(slot, (binding.prefix,)), binding)


def _is_as(one: Binding, other: Binding) -> bool:
    """Return whether a transform has the same keys and modes in these two."""
    settings = [(recorded_mode(binding), recorded(binding).turns_axis) for binding in (one, other)]
    return settings[0] == settings[1] and _summary(one) == _summary(other)


def _animators(binding: Binding) -> dict[tuple[str, int], bpy.types.FCurve]:
    """Return the channels that the animator has keyed, those of modes and turns among them."""
    names = (*WIDTHS, *SEGMENT_PROPERTIES)
    return {
        channel: curve for channel, curve in binding.curves.items() if channel[0].removeprefix(binding.prefix) in names
    }


def _summary(binding: Binding) -> dict:
    """Return what tells whether channels are the same."""
    return {channel: _summary_of(fcurve) for channel, fcurve in _animators(binding).items()}


def _summary_of(fcurve: bpy.types.FCurve) -> tuple:
    fields = {name: numbers for name, numbers in key_fields(fcurve).items() if not name.startswith("select")}
    modifiers = tuple((modifier.type, modifier.mute) for modifier in fcurve.modifiers)
    ((_, keys),) = read_keys([[fcurve]])[0] if len(fcurve.keyframe_points) else ((0, None),)
    cycles = None if keys is None else keys.cycles
    return b"".join(np.ascontiguousarray(numbers).tobytes() for numbers in fields.values()), (
        fcurve.extrapolation,
        fcurve.mute,
        modifiers,
        cycles,
    )


def _copy_channels(source: Binding, target: Binding) -> None:
    """Give a transform the keys and modes that it has in another Action."""
    fcurves = target.channelbag.fcurves
    for channel in _animators(target):
        fcurves.remove(target.curves.pop(channel))
    for channel, fcurve in _animators(source).items():
        target.curves[channel] = copy_fcurve(fcurve, target.channelbag)
    record_mode(target, recorded_mode(source))
    record_turns_axis(target, recorded(source).turns_axis)


def _go_back_to(rig: bpy.types.Object, changed: bpy.types.Action, original: bpy.types.Action, slot: Slot) -> None:
    """Let a rig move by an original again, if all of its keys are what it has by now."""
    if any(entry.changed == changed and entry.original == original for entry in _entries(rig)):
        return
    here, there = (
        {binding.prefix: binding for binding in bindings_in_slot(item)} for item in (slot, in_action(original, slot))
    )
    if here.keys() == there.keys() and all(_is_as(binding, there[prefix]) for prefix, binding in here.items()):
        exchange(rig, slot, original)
        _rename_in_notes(rig, changed, original)
        if not changed.users:
            bpy.data.actions.remove(changed)
