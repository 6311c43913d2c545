"""Which Action slots move something, and the F-curves in them, transform by transform.

A slot may have several users, and moves transforms of each: the object itself, and the bones of a rig.
`bindings_in_slot` is where a slot is taken apart.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..transforms import TURNS_PROPERTY, WIDTHS, Channel, Transform, split_path, transform_in

Curves = dict[Channel, bpy.types.FCurve]


@dataclass(frozen=True)
class Slot:
    """One of the slots that move something, with everything else that it moves."""

    action: bpy.types.Action
    handle: int
    users: tuple[bpy.types.Object, ...]
    strips: frozenset[tuple[int, int] | None]
    """The frames of the Action that strips show; None where it plays by itself."""

    @property
    def key(self) -> tuple[bpy.types.Action, int]:
        return self.action, self.handle

    @property
    def seen(self) -> tuple[int, int]:
        """The frames that are seen: those of the strips, and of all scenes where it plays by itself."""
        spans = [strip for strip in self.strips if strip is not None]
        if None in self.strips:
            scenes = {scene for obj in self.users for scene in obj.users_scene} or set(bpy.data.scenes)
            spans += [(scene.frame_start, scene.frame_end) for scene in scenes]
        return min(first for first, _ in spans), max(last for _, last in spans)

    @property
    def channelbag(self) -> bpy.types.ActionChannelbag | None:
        slot = slot_with(self.action, self.handle)
        return None if slot is None else action_get_channelbag_for_slot(self.action, slot)

    @property
    def fcurves(self) -> Iterable[bpy.types.FCurve]:
        return () if (channelbag := self.channelbag) is None else channelbag.fcurves

    @property
    def is_editable(self) -> bool:
        """Return whether its Action may be written: not where that is linked, or overrides what is.

        Python would be let write linked Actions, and overrides of them lose what is written when the file is opened.
        """
        return self.action.is_editable and self.action.override_library is None

    def plays_in(self, animated: bpy.types.Object) -> bool:
        """Return whether something moves by it outside of strips, or in the strip that is being edited."""
        data = animated.animation_data
        return data is not None and (data.action, data.action_slot_handle) == self.key


@dataclass(frozen=True, eq=False)
class Binding:
    """One transform that a slot animates: of each of the slot's users the same one."""

    slot: Slot
    prefix: str
    """From the user to what is moved, in data paths: none for the user itself."""

    channelbag: bpy.types.ActionChannelbag | None
    """The channelbag with the F-curves of the slot."""

    users: tuple[Transform, ...]
    find: Callable[[], Mapping[str, Curves]]
    """Looks for the F-curves under its prefix, and those under others along with them."""

    @cached_property
    def curves(self) -> Curves:
        """Its F-curves; looked for when they are first asked for."""
        return self.find()[self.prefix]

    @property
    def kind(self) -> type[Transform]:
        return type(self.users[0])

    @property
    def name(self) -> str:
        """The name for messages: that of its first user."""
        return self.users[0].name

    @property
    def moving(self) -> Curves:
        """Its channels of location, rotation and scale, which modes are for. What it has of others is none of ours."""
        return {
            (path, index): fcurve
            for (path, index), fcurve in self.curves.items()
            if path.removeprefix(self.prefix) in WIDTHS
        }

    @property
    def is_keyed(self) -> bool:
        """Return whether it has channels of location, rotation or scale, with keys or samples."""
        return any(fcurve.keyframe_points or fcurve.sampled_points for fcurve in self.moving.values())

    def ensure_curve(self, channel: Channel) -> bpy.types.FCurve:
        """Return the F-curve of a channel, made where there is none yet."""
        fcurve = self.curves.get(channel)
        if fcurve is None:
            path, index = channel
            fcurve = self.curves[channel] = self.channelbag.fcurves.new(path, index=index)
        return fcurve


def bindings_in_slot(slot: Slot, prefixes: Collection[str] | None = None) -> list[Binding]:
    """Return what a slot moves, transform by transform: these, or all that it has something of."""
    channelbag = slot.channelbag
    if prefixes is not None:
        return _bindings(slot, channelbag, prefixes, cache(partial(_curves_under, channelbag, prefixes)))
    curves: dict[str, Curves] = {"": {}}
    for fcurve in slot.fcurves:
        path = fcurve.data_path
        prefix, prop = split_path(path)
        if prefix in curves or prop in WIDTHS or prop == TURNS_PROPERTY:
            curves.setdefault(prefix, {})[path, fcurve.array_index] = fcurve
    return bindings_with(slot, channelbag, curves)


def read_again(bindings: Sequence[Binding]) -> list[Binding]:
    """Return these bindings with the F-curves that there are by now."""
    prefixes: dict[Slot, dict[str, None]] = {}
    for binding in bindings:
        prefixes.setdefault(binding.slot, {})[binding.prefix] = None
    result = {
        (slot, binding.prefix): binding
        for slot, of_slot in prefixes.items()
        for binding in bindings_in_slot(slot, of_slot)
    }
    return [result[binding.slot, binding.prefix] for binding in bindings]


def bindings_with(
    slot: Slot, channelbag: bpy.types.ActionChannelbag | None, curves: Mapping[str, Curves]
) -> list[Binding]:
    """Return what a slot moves by these F-curves, transform by transform: all there are of each prefix."""
    return _bindings(slot, channelbag, curves, lambda: curves)


def _bindings(
    slot: Slot,
    channelbag: bpy.types.ActionChannelbag | None,
    prefixes: Iterable[str],
    find: Callable[[], Mapping[str, Curves]],
) -> list[Binding]:
    bindings = (Binding(slot, prefix, channelbag, _users_of(slot, prefix), find) for prefix in prefixes)
    return [binding for binding in bindings if binding.users]


def _curves_under(channelbag: bpy.types.ActionChannelbag | None, prefixes: Iterable[str]) -> dict[str, Curves]:
    curves: dict[str, Curves] = {prefix: {} for prefix in prefixes}
    for fcurve in () if channelbag is None else channelbag.fcurves:
        path = fcurve.data_path
        if (of_prefix := curves.get(split_path(path)[0])) is not None:
            of_prefix[path, fcurve.array_index] = fcurve
    return curves


def _users_of(slot: Slot, prefix: str) -> tuple[Transform, ...]:
    """Return what a prefix stands for in each of the users of a slot that has it."""
    return tuple(user for obj in slot.users if (user := transform_in(obj, prefix)) is not None)


def slot_with(action: bpy.types.Action, handle: int) -> bpy.types.ActionSlot | None:
    return next((slot for slot in action.slots if slot.handle == handle), None)


def bindings_of(transforms: Iterable[Transform]) -> list[Binding]:
    """Return the slots that move these, and of each slot what is in it of them."""
    prefixes: dict[bpy.types.Object, dict[str, None]] = {}
    for transform in transforms:
        prefixes.setdefault(transform.animated, {})[transform.prefix] = None
    result = []
    for slot in slots_of(prefixes):
        desired = dict.fromkeys(prefix for user in slot.users for prefix in prefixes.get(user, ()))
        result += bindings_in_slot(slot, desired)
    return result


def bindings_in(actions: Iterable[bpy.types.Action]) -> list[Binding]:
    """Return what these Actions move, transform by transform."""
    return [binding for slot in slots_in(actions) for binding in bindings_in_slot(slot)]


def bindings_for(transform: Transform) -> list[Binding]:
    """Return what moves a transform, as if nothing else used the same slots: without a look at other objects."""
    slots = slots_alone(transform.animated)
    return [binding for slot in slots for binding in bindings_in_slot(slot, (transform.prefix,))]


def slots_of(objects: Iterable[bpy.types.Object]) -> list[Slot]:
    """Return the slots that move these objects, in Actions of their own and in NLA strips; each once."""
    known = {obj: slots_alone(obj) for obj in objects}
    desired = {slot.key for slots in known.values() for slot in slots}
    return _slots({action for action, _ in desired}, lambda slot: slot.key in desired, known)


def slots_in(actions: Iterable[bpy.types.Action]) -> list[Slot]:
    """Return the slots of these Actions that move an object."""
    actions = set(actions)
    return _slots(actions, lambda slot: slot.action in actions, {})


def _slots(
    actions: set[bpy.types.Action],
    is_desired: Callable[[Slot], bool],
    known: Mapping[bpy.types.Object, list[Slot]],
) -> list[Slot]:
    """Return slots of these Actions, by the names of their users, and of one user from the bottom of its NLA to the
    top: what depends on the order comes out the same whichever was edited.
    """
    if not actions:
        return []
    # A slot's own list of users may have some that are gone, which crashes Blender 5.2.
    owners = bpy.data.user_map(subset=actions, key_types={"ACTION"}, value_types={"OBJECT"})
    same: dict[tuple[bpy.types.Action, int], list[Slot]] = {}
    for obj in sorted(set().union(*owners.values()), key=lambda obj: obj.name_full):
        for slot in known[obj] if obj in known else slots_alone(obj):
            if is_desired(slot):
                same.setdefault(slot.key, []).append(slot)
    return [
        Slot(*key, tuple(slot.users[0] for slot in slots), frozenset().union(*(slot.strips for slot in slots)))
        for key, slots in same.items()
    ]


def slots_alone(obj: bpy.types.Object) -> list[Slot]:
    """Return the slots that move an object, as if nothing else used them."""
    data = obj.animation_data
    if data is None:
        return []
    result: dict[tuple[bpy.types.Action, int], set[tuple[int, int] | None]] = {}
    # Some of Blender's operators leave the handle of a slot that is no longer there.
    if data.action is not None and (slot := data.action_slot) is not None:
        result[data.action, slot.handle] = {None}
    if len(data.nla_tracks):
        for strip in strips_of(obj):
            if (action := strip.action) is not None and (slot := strip.action_slot) is not None:
                span = int(np.floor(strip.action_frame_start)), int(np.ceil(strip.action_frame_end))
                result.setdefault((action, slot.handle), set()).add(span)
    return [Slot(*key, (obj,), frozenset(strips)) for key, strips in result.items()]


def active_fcurves(animated: bpy.types.Object) -> bpy.types.bpy_prop_collection | tuple:
    """Return the F-curves of an object's slot. Looks at nothing else in the file, for it is asked of many objects."""
    data = animated.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return ()
    channelbag = action_get_channelbag_for_slot(data.action, data.action_slot)
    return () if channelbag is None else channelbag.fcurves


def strips_of(obj: bpy.types.Object) -> Iterator[bpy.types.NlaStrip]:
    """Return the strips in the NLA of an object, those in strips of strips among them."""
    return with_inner_strips(strip for track in obj.animation_data.nla_tracks for strip in track.strips)


def with_inner_strips(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """Yield strips, and those in strips of strips."""
    for strip in strips:
        yield strip
        yield from with_inner_strips(strip.strips)
