"""Which Action slots move something, and the F-curves in them, transform by transform.

A slot may have several users, and moves transforms of each: the object itself, and the bones of a rig.
`bindings_in_slot` is where a slot is taken apart.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import cast

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ...blender import existing
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
        slot = next((slot for slot in self.action.slots if slot.handle == self.handle), None)
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

    users: tuple[Transform, ...]

    curves: Curves
    """Its F-curves, those that were made meanwhile included."""

    @property
    def channelbag(self) -> bpy.types.ActionChannelbag:
        return existing(self.slot.channelbag)

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
    def keyed(self) -> list[bpy.types.FCurve]:
        """Those of these channels that have keys."""
        return [fcurve for fcurve in self.moving.values() if fcurve.keyframe_points]

    @property
    def is_keyed(self) -> bool:
        """Return whether it has channels of location, rotation or scale, with keys or samples."""
        return any(fcurve.keyframe_points or fcurve.sampled_points for fcurve in self.moving.values())

    def ensure_curve(self, channel: Channel) -> bpy.types.FCurve:
        """Return the F-curve of a channel, made where there is none yet."""
        fcurve = self.curves.get(channel)
        if fcurve is None:
            (path, index), fcurves = channel, self.channelbag.fcurves
            fcurve = self.curves[channel] = fcurves.find(path, index=index) or fcurves.new(path, index=index)
        return fcurve

    def remove_curve(self, channel: Channel) -> None:
        """Remove the F-curve of a channel, if it has one."""
        if (fcurve := self.curves.pop(channel, None)) is not None:
            self.channelbag.fcurves.remove(fcurve)


def bindings_in_slot(slot: Slot, prefixes: Collection[str] | None = None) -> list[Binding]:
    """Return what a slot moves, transform by transform: these, or all that it has something of."""
    curves: dict[str, Curves] = {prefix: {} for prefix in (("",) if prefixes is None else prefixes)}
    for fcurve in slot.fcurves:
        path = fcurve.data_path
        prefix, prop = split_path(path)
        if prefixes is None and (prop in WIDTHS or prop == TURNS_PROPERTY):
            curves.setdefault(prefix, {})
        if prefix in curves:
            curves[prefix][path, fcurve.array_index] = fcurve
    result = []
    for prefix, of_prefix in curves.items():
        if users := tuple(user for obj in slot.users if (user := transform_in(obj, prefix)) is not None):
            result.append(Binding(slot, prefix, users, of_prefix))
    return result


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
    desired = {slot.key for obj in objects for slot in slots_alone(obj)}
    return [slot for slot in slots_in(action for action, _ in desired) if slot.key in desired]


def slots_in(actions: Iterable[bpy.types.Action]) -> list[Slot]:
    """Return the slots of these Actions that move an object.

    They are ordered by the names of their users, and those of one user from the bottom of its NLA to the top: what
    depends on the order comes out the same whichever was edited.
    """
    actions = set(actions)
    if not actions:
        return []
    # A slot's own list of users may have some that are gone, which crashes Blender 5.2.
    owners = bpy.data.user_map(subset=actions, key_types={"ACTION"}, value_types={"OBJECT"})
    same: dict[tuple[bpy.types.Action, int], list[Slot]] = {}
    for obj in sorted(set().union(*owners.values()), key=lambda obj: obj.name_full):
        for slot in slots_alone(cast(bpy.types.Object, obj)):
            if slot.action in actions:
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
    for strip in strips_in(data.nla_tracks):
        if (action := strip.action) is not None and (slot := strip.action_slot) is not None:
            span = int(np.floor(strip.action_frame_start)), int(np.ceil(strip.action_frame_end))
            result.setdefault((action, slot.handle), set()).add(span)
    return [Slot(*key, (obj,), frozenset(strips)) for key, strips in result.items()]


def active_fcurves(animated: bpy.types.Object) -> Iterable[bpy.types.FCurve]:
    """Return the F-curves of an object's slot, without a look at anything else in the file."""
    return next((slot.fcurves for slot in slots_alone(animated) if slot.plays_in(animated)), ())


def strips_in(owners: Iterable[bpy.types.NlaTrack | bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """Yield the strips in NLA tracks, and those in strips of strips."""
    for owner in owners:
        for strip in owner.strips:
            yield strip
            yield from strips_in((strip,))
