"""Originals: the channels from before keys were baked, reduced or cleaned, kept in the file for the way back.

Keys are changed where they are, in their Action, for all that moves by it. The channels from before are kept in an
Action that nothing moves by, a *keeper*: under data paths that lead nowhere, in a slot that fits no object. So no
exporter takes them for a clip, and bones can be renamed meanwhile. Notes on what is moved say where they are, the
latest last: what was done last is taken back first. A keeper leaves the file with the last note that needs it.
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
"""The change that was made to the keys."""

NOT_DONE = {
    BAKED: n_("{name} is not baked, or now has another Action"),
    REDUCED: n_("{name} is neither reduced nor cleaned, or now has another Action"),
}
"""The reason why something cannot be taken back."""

DONE_SINCE = {
    BAKED: n_("{name} was baked since it was reduced: Un-Bake first"),
    REDUCED: n_("{name} was reduced since it was baked: Restore Keys first"),
    CLEANED: n_("{name} was cleaned since it was baked: Restore Keys first"),
}
"""The reason why what was done before cannot be taken back, by what was done last."""


class Originals:
    """Keeps what there is before keys are changed, in one keeper for all that is done to an Action."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._keepers: dict[bpy.types.Action, bpy.types.ActionChannelbag] = {}
        self._kept: set[tuple] = set()

    def keep(self, binding: Binding) -> list[Note]:
        """Keep the channels of a transform in a slot, and note that on all that moves by them.

        Returns the notes: none where this was done in this go already, through another one that moves by them.
        """
        slot = binding.slot
        if (place := (binding.prefix, *slot.key)) in self._kept:
            return []
        self._kept.add(place)
        if slot.action not in self._keepers:
            keeper = bpy.data.actions.new(f"{slot.action.name} Original")
            strip = keeper.layers.new("Original").strips.new(type="KEYFRAME")
            # Blender's glTF exporter takes all slots for objects that seem to fit; its FBX exporter asks paths alone.
            self._keepers[slot.action] = channelbag_in(strip, keeper.slots.new("WORLD", "Original"))
        channelbag, prefix = self._keepers[slot.action], f"kept[{len(self._kept)}]."
        for (path, _), fcurve in _moving(binding).items():
            copy_fcurve(fcurve, channelbag, prefix + path.removeprefix(binding.prefix))
        notes = [user.motion.bakes.add() for user in _noting(binding)]
        for note in notes:
            note.kind, note.original, note.kept_as = self._kind, cast(bpy.types.Action, channelbag.id_data), prefix
            note.changed, note.handle = slot.key
        return notes


def _noting(binding: Binding) -> Iterator[Transform]:
    """Yield what moves by a binding and can have notes: not what other files have."""
    return (user for user in binding.users if user.animated.is_editable)


def notes_of(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, list[Note]]]:
    """Yield what has notes, and those of them in use."""
    for transform in transforms:
        if len(transform.motion.bakes):
            yield transform, list(notes_in_use(transform))


def notes_in_use(transform: Transform) -> Iterator[Note]:
    """Yield the notes on what was done last to the keys that something moves by, the latest first.

    What was done before, and can be taken back after that, is none of it.
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
    """Return what was done last to the keys that something moves by, if those from before are still in the file."""
    return next((note.kind for note in notes_in_use(transform) if note.original is not None), None)


def refuse_without_original(transform: Transform, *kinds: str) -> str:
    """Return which of these kinds the keys are of that something was given last. `Refused` where they are of none, or
    the original is gone.
    """
    latest = last_change(transform)
    if latest is None or not any(note.kind in kinds and note.original is not None for note in transform.motion.bakes):
        raise Refused(NOT_DONE[kinds[0]], name=transform.name)
    if latest not in kinds:
        raise Refused(DONE_SINCE[latest], name=transform.name)
    return latest


def put_back(transform: Transform, kind: str, bindings: Iterable[Binding]) -> None:
    """Give something its keys from before they were baked or reduced, to the last handle, in all that moves it.

    That is what there was before all that was done of this kind on end. What was done before that stays.
    """
    for binding in bindings:
        target = None
        for note in _on(transform, binding)[::-1]:
            if note.original is not None and note.kind != kind:
                break
            target = note if note.original is not None else target
        if target is None:
            continue
        kept, old = _kept_by(target), _moving(binding)
        group = next((fcurve.group for fcurve in old.values() if fcurve.group is not None), None)
        for (path, index), fcurve in kept.items():
            channel = binding.prefix + path, index
            binding.curves[channel] = copy_fcurve(fcurve, binding.channelbag, channel[0])
            if group is not None and channel not in old:
                # The group from before may have the name of a bone that was renamed.
                binding.curves[channel].group = group
        for channel in old.keys() - {(binding.prefix + path, index) for path, index in kept}:
            binding.remove_curve(channel)
        _forget_from(target, binding)


def discard_originals(transform: Transform, kind: str, bindings: Iterable[Binding]) -> None:
    """Give up the way back from keys of this kind. Notes on what became of them stay."""
    for binding in bindings:
        for note in _on(transform, binding):
            if note.kind == kind and (keeper := note.original) is not None:
                for user in _noting(binding):
                    for same in _on(user, binding):
                        if (same.original, same.kept_as) == (keeper, note.kept_as):
                            same.original = None
                remove_unused(keeper)


def _moving(binding: Binding) -> Curves:
    """Return the channels of location, rotation, scale and turns."""
    turns = {channel: curve for channel, curve in binding.curves.items() if channel[0].endswith(TURNS_PROPERTY)}
    return binding.moving | turns


def _on(transform: Transform, binding: Binding) -> list[Note]:
    """Return the notes of a transform on a slot, the latest last."""
    return [note for note in transform.motion.bakes if (note.changed, note.handle) == binding.slot.key]


def _kept_by(note: Note) -> Curves:
    """Return the channels that a note says are kept, by their paths from what is moved on."""
    strip, prefix = existing(note.original).layers[0].strips[0], note.kept_as
    fcurves = cast(bpy.types.ActionKeyframeStrip, strip).channelbags[0].fcurves
    kept = (fcurve for fcurve in fcurves if fcurve.data_path.startswith(prefix))
    return {(fcurve.data_path.removeprefix(prefix), fcurve.array_index): fcurve for fcurve in kept}


def _forget_from(first: Note, binding: Binding) -> None:
    """Remove this note and all later ones on a slot, on all that moves by it."""
    which, keepers = (first.original, first.kept_as), set()
    for user in _noting(binding):
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
