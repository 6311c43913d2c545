"""Originals: the Actions that there were before keys were baked or reduced, kept in the file for the way back.

What is to have other keys gets them in a copy of its Action; for what there is of a rig, see `rigs`. Which copy stands
for which original is noted on what is moved, the latest last: what was done last is taken back first.
"""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..actions.slots import Binding, bindings_for, in_action
from ..transforms import Refused, Transform
from . import rigs
from .copies import (
    BAKED,
    REDUCED,
    Lookup,
    copied,
    entries_in_use,
    exchange,
    in_copy,
    let_rest,
    note,
    used_in,
)

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
        raise Refused(
            rpt_("{name}: leave the strip that is being edited first (NLA Editor, Tab)").format(name=transform.name)
        )


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
    if transform.animated.pose is not None:
        return rigs.move_by_copy(transform, binding, kind)
    original, changed = binding.slot.action, copied(binding.slot, kind)
    note(transform, kind, changed, original)
    exchange(transform.animated, binding.slot, changed)
    return in_copy(transform, binding, changed)


def has_original(transform: Transform, kind: str) -> bool:
    """Return whether something moves by a copy with keys of this kind, and the original is still in the file."""
    return any(entry.kind == kind and entry.original is not None for entry in entries_in_use(transform))


def refuse_without_original(transform: Transform, kind: str) -> None:
    """Raise `Refused` where keys of this kind are not what something was given last, or the original is gone."""
    notes = [entry for entry in transform.motion.bakes if entry.kind == kind and entry.original is not None]
    latest = next((entry.kind for entry in entries_in_use(transform) if entry.original is not None), None)
    if latest is None or not notes:
        raise Refused(rpt_(NOT_DONE[kind]).format(name=transform.name))
    if latest != kind:
        raise Refused(rpt_(DONE_SINCE[latest]).format(name=transform.name))


def refuse_without_slot(transform: Transform, kind: str) -> None:
    """Raise `Refused` where an original no longer has the slot that something moved by."""
    for entry in entries_in_use(transform):
        slot, original = used_in(transform.animated, entry.changed), entry.original
        if entry.kind == kind and original is not None and in_action(original, slot) is None:
            raise Refused(rpt_(WITHOUT_SLOT).format(name=transform.name, action=original.name))


def put_back(transform: Transform, kind: str, lookup: Lookup) -> None:
    """Let something move again by the Actions from before its keys were baked or reduced, to the last handle.

    What was done before that stays, and so do notes on copies that it does not move by any more. The `lookup` is for
    all that this is done with in one go.
    """
    if transform.animated.pose is not None:
        rigs.put_back(transform, kind, lookup)
        return
    bakes = transform.motion.bakes
    for number in reversed(range(len(bakes))):
        entry = bakes[number]
        slot = used_in(transform.animated, entry.changed)
        if entry.original is None or slot is None:
            continue
        if entry.kind != kind:
            break
        changed = entry.changed
        if entry.is_property_set("mode"):
            # From a version that kept modes on objects: the original takes it from there.
            transform.motion.mode = entry.mode
        bindings = [lookup.find(item, transform.prefix) for item in (slot, in_action(entry.original, slot))]
        let_rest(transform, entry, *bindings)
        exchange(transform.animated, slot, entry.original)
        bakes.remove(number)
        if not changed.users:
            bpy.data.actions.remove(changed)
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
