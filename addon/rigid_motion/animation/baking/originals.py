"""Originals: the channels from before keys were baked, reduced or cleaned, kept in the file for the way back.

Keys are changed in place in their Action, for all its users. The channels from before are kept in an unused Action, the
*keeper*, with data paths that lead nowhere, in a slot that fits no object. So no exporter takes them for a clip, and
bones can be renamed. Notes on the users say where the channels are, the latest last; the last change is undone first.
A keeper is removed from the file with the last note that needs it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import cast

import bpy
from bpy.app.translations import pgettext_n as n_

from ...blender import channelbag_in, existing
from ..actions.channels import copy_fcurve
from ..actions.slots import Binding, Curves, slots_alone
from ..transforms import TURNS_PROPERTY, Note, Refused, Transform

BAKED, REDUCED, CLEANED = "BAKED", "REDUCED", "CLEANED"
"""The kinds of changes to keys."""

NOT_DONE = {
    BAKED: n_("{name} is not baked, or now has another Action"),
    REDUCED: n_("{name} is neither reduced nor cleaned, or now has another Action"),
}
"""The messages for why a change cannot be undone."""

DONE_SINCE = {
    BAKED: n_("{name} was baked since it was reduced: Un-Bake first"),
    REDUCED: n_("{name} was reduced since it was baked: Restore Keys first"),
    CLEANED: n_("{name} was cleaned since it was baked: Restore Keys first"),
}
"""The messages for why an earlier change cannot be undone, by the kind of the last change."""


class Originals:
    """Keeps channels before their keys are changed, in one keeper for each Action."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._keepers: dict[bpy.types.Action, bpy.types.ActionChannelbag] = {}
        self._kept: set[tuple] = set()

    def keep(self, binding: Binding) -> list[Note]:
        """Keep the channels of a transform in a slot, and add notes to all users of these channels.

        Returns the notes. They are empty if this call was already made for another user of the same channels.
        """
        slot = binding.slot
        if (place := (binding.prefix, *slot.key)) in self._kept:
            return []
        self._kept.add(place)
        if slot.action not in self._keepers:
            keeper = bpy.data.actions.new(f"{slot.action.name} Original")
            strip = keeper.layers.new("Original").strips.new(type="KEYFRAME")
            # Blender's glTF exporter takes every slot that seems to fit an object; its FBX exporter checks only paths.
            self._keepers[slot.action] = channelbag_in(strip, keeper.slots.new("WORLD", "Original"))
        channelbag, prefix = self._keepers[slot.action], f"kept[{len(self._kept)}]."
        for (path, _), fcurve in _transform_curves(binding).items():
            copy_fcurve(fcurve, channelbag, prefix + path.removeprefix(binding.prefix))
        notes = [user.motion.bakes.add() for user in _editable_users(binding)]
        for note in notes:
            note.kind, note.original, note.kept_as = self._kind, cast(bpy.types.Action, channelbag.id_data), prefix
            note.changed, note.handle = slot.key
        return notes


def _editable_users(binding: Binding) -> Iterator[Transform]:
    """Yield the users of a binding that can have notes: those not linked from other files."""
    return (user for user in binding.users if user.animated.is_editable)


def notes_of(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, list[Note]]]:
    """Yield the transforms with notes, and their notes in use."""
    for transform in transforms:
        if len(transform.motion.bakes):
            yield transform, list(notes_in_use(transform))


def notes_in_use(transform: Transform) -> Iterator[Note]:
    """Yield the notes on the last change of the keys that a transform uses, the latest first.

    Earlier changes of another kind, which can be undone afterwards, are left out.
    """
    bakes = transform.motion.bakes
    if len(bakes):
        keys, last = {slot.key for slot in slots_alone(transform.animated)}, dict[tuple, str]()
        for note in reversed(bakes):
            key = note.changed, note.handle
            if key in keys and last.get(key, note.kind) == note.kind:
                yield note
                if note.original is not None:
                    last[key] = note.kind


def last_change(transform: Transform) -> str | None:
    """Return the kind of the last change to a transform's keys, if the keys from before are still in the file."""
    return next((note.kind for note in notes_in_use(transform) if note.original is not None), None)


def refuse_without_original(transform: Transform, *kinds: str) -> str:
    """Return the kind of the last change to a transform's keys, one of these kinds. Raise `Refused` if it is none of
    them, or the original is gone.
    """
    latest = last_change(transform)
    if latest is None or not any(note.kind in kinds and note.original is not None for note in transform.motion.bakes):
        raise Refused(NOT_DONE[kinds[0]], name=transform.name)
    if latest not in kinds:
        raise Refused(DONE_SINCE[latest], name=transform.name)
    return latest


def put_back(transform: Transform, kind: str, bindings: Iterable[Binding]) -> None:
    """Restore a transform's keys from before they were baked, reduced or cleaned, handles included, in these bindings.

    All consecutive last changes of this kind are undone. Changes before these stay.
    """
    for binding in bindings:
        target = None
        for note in _notes_about(transform, binding)[::-1]:
            if note.original is not None and note.kind != kind:
                break
            target = note if note.original is not None else target
        if target is None:
            continue
        kept, old = _kept_by(target), _transform_curves(binding)
        group = next((fcurve.group for fcurve in old.values() if fcurve.group is not None), None)
        for (path, index), fcurve in kept.items():
            channel = binding.prefix + path, index
            binding.curves[channel] = copy_fcurve(fcurve, binding.channelbag, channel[0])
            if group is not None and channel not in old:
                # The kept group may have the name of a bone that was renamed.
                binding.curves[channel].group = group
        for channel in old.keys() - {(binding.prefix + path, index) for path, index in kept}:
            binding.remove_curve(channel)
        _forget_from(target, binding)


def discard_originals(transform: Transform, kind: str, bindings: Iterable[Binding]) -> None:
    """Discard the originals of changes of this kind. The notes on the results stay."""
    for binding in bindings:
        for note in _notes_about(transform, binding):
            if note.kind == kind and (keeper := note.original) is not None:
                for user in _editable_users(binding):
                    for same in _notes_about(user, binding):
                        if (same.original, same.kept_as) == (keeper, note.kept_as):
                            same.original = None
                remove_unused(keeper)


def _transform_curves(binding: Binding) -> Curves:
    """Return the channels of location, rotation, scale and turns."""
    turns = {channel: curve for channel, curve in binding.curves.items() if channel[0].endswith(TURNS_PROPERTY)}
    return binding.moving | turns


def _notes_about(transform: Transform, binding: Binding) -> list[Note]:
    """Return the notes of a transform about a slot, the latest last."""
    return [note for note in transform.motion.bakes if (note.changed, note.handle) == binding.slot.key]


def _kept_by(note: Note) -> Curves:
    """Return the channels kept for a note, by their paths relative to the transform."""
    strip, prefix = existing(note.original).layers[0].strips[0], note.kept_as
    fcurves = cast(bpy.types.ActionKeyframeStrip, strip).channelbags[0].fcurves
    kept = (fcurve for fcurve in fcurves if fcurve.data_path.startswith(prefix))
    return {(fcurve.data_path.removeprefix(prefix), fcurve.array_index): fcurve for fcurve in kept}


def _forget_from(first: Note, binding: Binding) -> None:
    """Remove this note and all later ones about a slot, on all its users."""
    which, keepers = (first.original, first.kept_as), set()
    for user in _editable_users(binding):
        bakes = user.motion.bakes
        numbers = [n for n, note in enumerate(bakes) if (note.changed, note.handle) == binding.slot.key]
        at = next((n for n in numbers if (bakes[n].original, bakes[n].kept_as) == which), len(bakes))
        for number in reversed([n for n in numbers if n >= at]):
            if (keeper := bakes[number].original) is not None:
                keepers.add(keeper)
            bakes.remove(number)
    for keeper in keepers:
        remove_unused(keeper)


def remove_unused(keeper: bpy.types.Action) -> None:
    if not keeper.users:
        bpy.data.actions.remove(keeper)
