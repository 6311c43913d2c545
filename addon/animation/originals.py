"""Originals: the Actions that objects had before they were baked or reduced, kept in the file for the way back.

An object that is to have other keys gets them in a copy of its Action. Which copy stands for which original is noted on
the object, the latest last: what was done last is taken back first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import bpy

from . import live
from .filling import adopt
from .slots import Refused, Slot, curves_in, slots_of

if TYPE_CHECKING:
    from .properties import ChangedAction

BAKED, REDUCED = "BAKED", "REDUCED"
"""What was done to the keys."""

WAYS_BACK = {BAKED: "Un-Bake", REDUCED: "Restore Keys"}
"""What takes it back."""


def refuse_tweak_mode(obj: bpy.types.Object) -> None:
    """Raise `Refused` where a strip is being edited: its Action cannot be exchanged meanwhile."""
    if obj.animation_data is not None and obj.animation_data.use_tweak_mode:
        raise Refused(f"{obj.name}: leave the strip that is being edited first (NLA Editor, Tab)")


def move_by_copy(obj: bpy.types.Object, slot: Slot, kind: str) -> Slot:
    """Let an object move by a copy of what it moves by, to be given other keys.

    Parameters
    ----------
    obj : bpy.types.Object
    slot : Slot
        One of those that move it.
    kind : str
        What is to be done to its keys, `BAKED` or `REDUCED`.

    Returns
    -------
    Slot
        The copy, in an Action of its own. The original stays in the file, for `put_back`.
    """
    original, changed = slot.action, slot.action.copy()
    changed.name = f"{original.name} {kind.title()}"
    for other in [other for other in changed.slots if other.handle != slot.handle]:
        changed.slots.remove(other)
    entry = obj.rigid_motion.bakes.add()
    entry.kind, entry.changed, entry.original, entry.mode = kind, changed, original, obj.rigid_motion.mode
    _exchange(obj, original, changed)
    return next(copy for copy in slots_of([obj]) if copy.action == changed)


def entries_in_use(obj: bpy.types.Object) -> Iterator[ChangedAction]:
    """The notes of an object on copies that it moves by, the latest first."""
    bakes = obj.rigid_motion.bakes
    if len(bakes):
        actions = {slot.action for slot in slots_of([obj])}
        yield from (entry for entry in reversed(bakes) if entry.changed in actions)


def has_original(obj: bpy.types.Object, kind: str) -> bool:
    """Whether an object moves by a copy with keys of this kind, and the original is still in the file."""
    return any(entry.kind == kind and entry.original is not None for entry in entries_in_use(obj))


def refuse_without_original(obj: bpy.types.Object, kind: str) -> None:
    """Raise `Refused` where keys of this kind are not what an object was given last, or the original is gone."""
    notes = [entry for entry in obj.rigid_motion.bakes if entry.kind == kind and entry.original is not None]
    latest = next((entry.kind for entry in entries_in_use(obj) if entry.original is not None), None)
    if latest is None or not notes:
        raise Refused(f"{obj.name} is not {kind.lower()}, or has another Action by now")
    if latest != kind:
        raise Refused(f"{obj.name} was {latest.lower()} since it was {kind.lower()}: {WAYS_BACK[latest]} first")


def put_back(obj: bpy.types.Object, kind: str) -> None:
    """Give an object the Actions back that it had before its keys were baked or reduced, to the last handle.

    What was done before that stays, and so do notes on copies that it does not move by any more.
    """
    bakes = obj.rigid_motion.bakes
    with live.paused():
        for place in reversed(range(len(bakes))):
            entry = bakes[place]
            if entry.original is None or all(slot.action != entry.changed for slot in slots_of([obj])):
                continue
            if entry.kind != kind:
                break
            changed = entry.changed
            _exchange(obj, changed, entry.original)
            # The mode is animated in the copy, and need not be in the original.
            obj.rigid_motion.mode = entry.mode
            bakes.remove(place)
            if not changed.users:
                bpy.data.actions.remove(changed)
        for slot in slots_of([obj]):
            adopt(slot, curves_in(slot.channelbag))
    live.refresh([obj])


def let_go(obj: bpy.types.Object, kind: str) -> None:
    """Give up the way back: originals of this kind leave the file, unless something else holds them."""
    bakes = obj.rigid_motion.bakes
    for entry in list(entries_in_use(obj)):
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
