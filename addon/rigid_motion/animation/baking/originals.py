"""Originals: the Actions that there were before keys were baked or reduced, kept in the file for the way back.

What is to have other keys gets them in a copy of its Action. Which copy stands for which original is noted on what is
moved, the latest last: what was done last is taken back first.

One Action moves many bones, and each of them has a way back of its own. The first bone that is given other keys has its
rig move by a copy of the Action. So long as a bone is in that copy as it is in the original, it can be given others
there too; otherwise there is a copy of the copy. On the way back a bone gets its own channels from its original, and
all others stay as they are. The rig goes back to an original once that is what its Action has come to be again. Of an
object all of the Action is exchanged.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import bpy
from bpy.app.translations import pgettext_n as n_

from ..actions.channels import copy_fcurve, key_fields, read_cycles
from ..actions.records import keep_names, record_mode, record_turns_axis, recorded, recorded_mode
from ..actions.slots import (
    Binding,
    Slot,
    bindings_for,
    bindings_in_slot,
    bindings_with,
    counterpart_in,
    in_action,
    slots_alone,
    slots_of,
    strips_of,
)
from ..transforms import SEGMENT_PROPERTIES, WIDTHS, Refused, Transform, difference_constraints

BAKED, REDUCED = "BAKED", "REDUCED"
"""The change that was made to the keys."""

NOT_DONE = {
    BAKED: n_("{name} is not baked, or has another Action by now"),
    REDUCED: n_("{name} is not reduced, or has another Action by now"),
}
"""The reason why something cannot be taken back."""

DONE_SINCE = {
    BAKED: n_("{name} was baked since it was reduced: Un-Bake first"),
    REDUCED: n_("{name} was reduced since it was baked: Restore Keys first"),
}
"""The reason why what was done before cannot be taken back, by what was done last."""


WITHOUT_SLOT = n_(
    "{name} cannot get its keys back: their slot was taken out of the Action {action}. "
    "Choose by hand the Action that has them by now"
)
"""The reason why something cannot be taken back although its original is still in the file."""


def refuse_tweak_mode(transform: Transform) -> None:
    """Raise `Refused` where a strip is being edited: its Action cannot be exchanged meanwhile."""
    data = transform.animated.animation_data
    if data is not None and data.use_tweak_mode:
        raise Refused(n_("{name}: leave the strip that is being edited first (NLA Editor, Tab)"), name=transform.name)


def copied(slot: Slot, kind: str) -> bpy.types.Action:
    """Return a copy of an Action with one slot, to be given other keys in a way, `BAKED` or `REDUCED`."""
    changed = slot.action.copy()
    name = re.sub(rf" {kind.title()}(\.\d+)?$", "", slot.action.name)
    changed.name = f"{name} {kind.title()}"
    kept = {slot.handle, slot.differences}
    for other in [other for other in changed.slots if other.handle not in kept]:
        changed.slots.remove(other)
    for notes in (changed.rigid_motion.slots, changed.rigid_motion.bone_slots):
        for number in [number for number, one in enumerate(notes) if one.handle != slot.handle][::-1]:
            notes.remove(number)
    return changed


def let_rest(transform: Transform, entry: bpy.types.PropertyGroup, changed: Binding, original: Binding) -> None:
    """Give properties that got keys only with a copy the values that they had before."""
    for row, (path, index) in transform.channels.items():
        before = original.curves.get((path, index))
        if (path, index) in changed.curves and (before is None or before.mute):
            getattr(transform.carrier, path.removeprefix(transform.prefix))[index] = entry.components[row]


def used_in(animated: bpy.types.Object, action: bpy.types.Action | None) -> Slot | None:
    """Return the slot of an Action that something moves by, as if nothing else used it."""
    return next((slot for slot in slots_alone(animated) if slot.action == action), None)


def in_copy(transform: Transform, binding: Binding, changed: bpy.types.Action) -> Binding:
    """Return something in the copy that it moves by, which has the same channels as the original."""
    slot = used_in(transform.animated, changed)
    channelbag = slot.channelbag
    result = {channel: channelbag.fcurves.find(channel[0], index=channel[1]) for channel in binding.curves}
    curves = {channel: fcurve for channel, fcurve in result.items() if fcurve is not None}
    return bindings_with(slot, channelbag, {binding.prefix: curves})[0]


class Lookup:
    """The same transforms in one slot and another, and who else moves by it: each slot is looked through once."""

    def __init__(self, transforms: Iterable[Transform]) -> None:
        self._prefixes = {transform.prefix for transform in transforms}
        self._found: dict[tuple, dict[str, Binding]] = {}
        self._shared: dict[tuple, bool] = {}

    def find(self, slot: Slot, prefix: str) -> Binding:
        key = slot.action.session_uid, slot.handle, slot.users
        if key not in self._found:
            self._found[key] = {binding.prefix: binding for binding in bindings_in_slot(slot, self._prefixes)}
        return self._found[key][prefix]

    def is_shared(self, rig: bpy.types.Object, slot: Slot) -> bool:
        """Return whether others than a rig move by its slot as well."""
        key = rig, slot.key
        if key not in self._shared:
            self._shared[key] = _is_shared(rig, slot)
        return self._shared[key]


def exchange(obj: bpy.types.Object, old: Slot, new: bpy.types.Action) -> None:
    """Let an object move by the same slot in another Action, wherever it moves by this one."""
    shown_by = [(obj.animation_data, old.handle)]
    shown_by += [(strip, old.handle) for strip in strips_of(obj)]
    shown_by += [(constraint, old.differences) for constraint in difference_constraints(obj)]
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
        actions = {slot.action for slot in slots_alone(transform.animated)}
        yield from (entry for entry in reversed(bakes) if entry.changed in actions)


def has_original(transform: Transform, kind: str) -> bool:
    """Return whether something moves by a copy with keys of this kind, and the original is still in the file."""
    return any(entry.kind == kind and entry.original is not None for entry in entries_in_use(transform))


def refuse_without_original(transform: Transform, kind: str) -> None:
    """Raise `Refused` where keys of this kind are not what something was given last, or the original is gone."""
    notes = [entry for entry in transform.motion.bakes if entry.kind == kind and entry.original is not None]
    latest = next((entry.kind for entry in entries_in_use(transform) if entry.original is not None), None)
    if latest is None or not notes:
        raise Refused(NOT_DONE[kind], name=transform.name)
    if latest != kind:
        raise Refused(DONE_SINCE[latest], name=transform.name)


def refuse_without_slot(transform: Transform, kind: str) -> None:
    """Raise `Refused` where an original no longer has the slot that something moved by."""
    for entry in entries_in_use(transform):
        slot, original = used_in(transform.animated, entry.changed), entry.original
        if entry.kind == kind and original is not None and in_action(original, slot) is None:
            raise Refused(WITHOUT_SLOT, name=transform.name, action=original.name)


def move_by_copy(transform: Transform, binding: Binding, kind: str) -> Binding:
    """Let something move by a copy of what it moves by, to be given other keys.

    Parameters
    ----------
    transform : Transform
    binding : Binding
        One of those that move it.
    kind : str
        What is to be done to its keys, `BAKED` or `REDUCED`.

    Returns
    -------
    Binding
        The copy, in an Action of its own. The original stays in the file, for `put_back`.
    """
    rig, original = transform.animated, binding.slot.action
    if rig.pose is None:
        changed = copied(binding.slot, kind)
        exchange(rig, binding.slot, changed)
    elif (changed := _copy_of(rig, binding.slot)) is None:
        # Not in this go, but before: it may be in a copy by now itself.
        noted = (entry.original for entry in _entries(rig) if entry.changed == original)
        before = next((action for action in noted if action is not None), None)
        changed, slot = original, None if before is None else in_action(before, binding.slot)
        is_shared = _is_shared(rig, binding.slot)
        if slot is None or is_shared or not _is_as(*bindings_in_slot(slot, (binding.prefix,)), binding):
            changed = _leave_for_copy(rig, binding.slot, kind)
        else:
            original = before
    entry = transform.motion.bakes.add()
    entry.kind, entry.changed, entry.original = kind, changed, original
    entry.components = transform.components()
    return in_copy(transform, binding, changed)


def put_back(transform: Transform, kind: str, lookup: Lookup) -> None:
    """Give something its keys from before they were baked or reduced, to the last handle.

    What was done before that stays, and so do notes on copies that it does not move by any more. The `lookup` is for
    all that this is done with in one go.
    """
    bakes = transform.motion.bakes
    for number in reversed(range(len(bakes))):
        entry = bakes[number]
        slot = used_in(transform.animated, entry.changed)
        if slot is None or entry.original is None:
            continue
        if entry.kind != kind:
            break
        original = entry.original
        if transform.animated.pose is not None and lookup.is_shared(transform.animated, slot):
            # The others keep the keys that they have.
            slot = used_in(transform.animated, _leave_for_copy(transform.animated, slot, kind))
        changed = entry.changed
        binding, before = (lookup.find(item, transform.prefix) for item in (slot, in_action(original, slot)))
        let_rest(transform, entry, binding, before)
        bakes.remove(number)
        if transform.animated.pose is None:
            exchange(transform.animated, slot, original)
        else:
            _copy_channels(before, binding)
            _go_back_to(transform.animated, changed, original, slot)
        if not changed.users:
            bpy.data.actions.remove(changed)
    if not transform.is_part:
        transform.note_original(channel for binding in bindings_for(transform) for channel in binding.filled)


def discard_originals(transform: Transform, kind: str) -> None:
    """Give up the way back: originals of this kind leave the file, unless they are used elsewhere or are assets."""
    bakes = transform.motion.bakes
    for entry in list(entries_in_use(transform)):
        original = entry.original
        if entry.kind == kind and original is not None:
            # What the original itself was made of can still be put back: the copy is in its place there.
            for earlier in bakes:
                if earlier.changed == original:
                    earlier.changed = entry.changed
            entry.original = None
            # Importers keep their Actions by fake users; an asset is kept on purpose.
            if original.users == int(original.use_fake_user) and original.asset_data is None:
                bpy.data.actions.remove(original)


def _copy_of(rig: bpy.types.Object, slot: Slot) -> bpy.types.Action | None:
    """Return the Action with other keys for parts of this slot that a rig moves by, None where there is none yet."""
    noted = {entry.changed for entry in _entries(rig) if entry.original == slot.action}
    # One that somebody has put the original in place of by hand is not used any more.
    return next((item for item in noted if used_in(rig, item) is not None and in_action(item, slot) is not None), None)


def _entries(rig: bpy.types.Object) -> Iterator[bpy.types.PropertyGroup]:
    """Yield the notes on all that there is of a rig."""
    yield from rig.rigid_motion.bakes
    for bone in rig.pose.bones:
        yield from bone.rigid_motion.bakes


def _is_shared(rig: bpy.types.Object, slot: Slot) -> bool:
    return any(item.users != (rig,) for item in slots_of([rig]) if item.key == slot.key)


def _leave_for_copy(rig: bpy.types.Object, slot: Slot, kind: str) -> bpy.types.Action:
    """Let a rig move by a copy of what it moves by, and return that."""
    changed = copied(slot, kind)
    exchange(rig, slot, changed)
    _rename_in_notes(rig, slot.action, changed)
    keep_names(rig)
    return changed


def _rename_in_notes(rig: bpy.types.Object, old: bpy.types.Action, new: bpy.types.Action) -> None:
    for entry in _entries(rig):
        if entry.changed == old:
            entry.changed = new


def _is_as(one: Binding, other: Binding) -> bool:
    """Return whether a transform has the same keys and modes in these two."""
    settings = [(recorded_mode(binding), recorded(binding).turns_axis) for binding in (one, other)]
    curves = [_animators(binding) for binding in (one, other)]
    return (
        settings[0] == settings[1]
        and curves[0].keys() == curves[1].keys()
        and all(_summary(fcurve) == _summary(curves[1][channel]) for channel, fcurve in curves[0].items())
    )


def _animators(binding: Binding) -> dict[tuple[str, int], bpy.types.FCurve]:
    """Return the channels that the animator has keyed, those of modes and turns among them."""
    names = (*WIDTHS, *SEGMENT_PROPERTIES)
    return {
        channel: curve for channel, curve in binding.curves.items() if channel[0].removeprefix(binding.prefix) in names
    }


def _summary(fcurve: bpy.types.FCurve) -> tuple:
    """Return what tells whether channels are the same."""
    fields = key_fields(fcurve.keyframe_points).items()
    numbers = [numbers.tobytes() for name, numbers in fields if not name.startswith("select")]
    modifiers = [(modifier.type, modifier.mute) for modifier in fcurve.modifiers]
    return numbers, fcurve.extrapolation, fcurve.mute, modifiers, read_cycles(fcurve.modifiers)


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
