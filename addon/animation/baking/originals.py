"""Originals: the Actions that there were before keys were baked or reduced, kept in the file for the way back.

What is to have other keys gets them in a copy of its Action. Which copy stands for which original is noted on what is
moved, the latest last: what was done last is taken back first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import SlotTransform, slot_transforms_of
from ..transforms import Refused, Transform

BAKED, REDUCED = "BAKED", "REDUCED"
"""What was done to the keys."""

WAYS_BACK = {BAKED: "Un-Bake", REDUCED: "Restore Keys"}
"""What takes it back."""


def refuse_tweak_mode(transform: Transform) -> None:
    """Raise `Refused` where a strip is being edited: its Action cannot be exchanged meanwhile."""
    data = transform.animated.animation_data
    if data is not None and data.use_tweak_mode:
        raise Refused(f"{transform.name}: leave the strip that is being edited first (NLA Editor, Tab)")


def move_by_copy(transform: Transform, place: SlotTransform, kind: str) -> SlotTransform:
    """Let something move by a copy of what it moves by, to be given other keys.

    Parameters
    ----------
    transform : Transform
    place : SlotTransform
        One of those that move it.
    kind : str
        What is to be done to its keys, `BAKED` or `REDUCED`.

    Returns
    -------
    SlotTransform
        The copy, in an Action of its own. The original stays in the file, for `put_back`.
    """
    original, changed = place.slot.action, place.slot.action.copy()
    changed.name = f"{original.name} {kind.title()}"
    for other in [other for other in changed.slots if other.handle != place.slot.handle]:
        changed.slots.remove(other)
    entry = transform.motion.bakes.add()
    entry.kind, entry.changed, entry.original = kind, changed, original
    _exchange(transform.animated, original, changed)
    copies = slot_transforms_of([transform])
    return next(copy for copy in copies if copy.slot.action == changed and copy.prefix == place.prefix)


def entries_in_use(
    transform: Transform, places: Iterable[SlotTransform] | None = None
) -> Iterator[bpy.types.PropertyGroup]:
    """The notes on copies that something moves by, the latest first. `places` move it, where that is known already."""
    bakes = transform.motion.bakes
    if len(bakes):
        places = slot_transforms_of([transform]) if places is None else places
        actions = {place.slot.action for place in places}
        yield from (entry for entry in reversed(bakes) if entry.changed in actions)


def has_original(transform: Transform, kind: str) -> bool:
    """Whether something moves by a copy with keys of this kind, and the original is still in the file."""
    return any(entry.kind == kind and entry.original is not None for entry in entries_in_use(transform))


def refuse_without_original(transform: Transform, kind: str) -> None:
    """Raise `Refused` where keys of this kind are not what something was given last, or the original is gone."""
    notes = [entry for entry in transform.motion.bakes if entry.kind == kind and entry.original is not None]
    latest = next((entry.kind for entry in entries_in_use(transform) if entry.original is not None), None)
    if latest is None or not notes:
        raise Refused(f"{transform.name} is not {kind.lower()}, or has another Action by now")
    if latest != kind:
        raise Refused(f"{transform.name} was {latest.lower()} since it was {kind.lower()}: {WAYS_BACK[latest]} first")


def put_back(transform: Transform, kind: str) -> None:
    """Let something move again by the Actions from before its keys were baked or reduced, to the last handle.

    What was done before that stays, and so do notes on copies that it does not move by any more.
    """
    bakes = transform.motion.bakes
    for number in reversed(range(len(bakes))):
        entry = bakes[number]
        if entry.original is None or all(
            place.slot.action != entry.changed for place in slot_transforms_of([transform])
        ):
            continue
        if entry.kind != kind:
            break
        changed = entry.changed
        if entry.is_property_set("mode"):
            # From a version that kept modes on objects: the original takes it from there.
            transform.motion.mode = entry.mode
        _exchange(transform.animated, changed, entry.original)
        bakes.remove(number)
        if not changed.users:
            bpy.data.actions.remove(changed)
    transform.note_original(channel for place in slot_transforms_of([transform]) for channel in place.filled)


def discard_originals(transform: Transform, kind: str) -> None:
    """Give up the way back: originals of this kind leave the file, unless something else holds them."""
    bakes = transform.motion.bakes
    for entry in list(entries_in_use(transform)):
        original = entry.original
        if entry.kind == kind and original is not None:
            # What the original itself was made of can still be put back: the copy is in its place there.
            for earlier in bakes:
                if earlier.changed == original:
                    earlier.changed = entry.changed
            entry.original = None
            if not original.users:
                bpy.data.actions.remove(original)


def _exchange(obj: bpy.types.Object, old: bpy.types.Action, new: bpy.types.Action) -> None:
    """Let an object move by another Action, with the slot of the same name in it."""
    data = obj.animation_data
    strips = [strip for track in data.nla_tracks for strip in track.strips]
    for user in (data, *strips):
        if user.action == old:
            name = user.action_slot.identifier
            user.action = new
            user.action_slot = new.slots[name]
