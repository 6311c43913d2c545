"""Action slots: which ones move given objects and bones, and the F-curves in them, transform by transform.

A slot may have several users, and moves transforms of each: the object itself, and the bones of a rig.
`bindings_in_slot` splits a slot into these transforms.
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
    """A slot that moves objects, with its users and the frames that are played."""

    action: bpy.types.Action
    handle: int
    users: tuple[bpy.types.Object, ...]
    strips: frozenset[tuple[int, int] | None]
    """The frames of the Action that NLA strips show; None stands for playing without a strip."""

    @property
    def key(self) -> tuple[bpy.types.Action, int]:
        return self.action, self.handle

    @property
    def seen(self) -> tuple[int, int]:
        """The frames that are shown: those of the strips, and of the users' scenes if it plays without a strip."""
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
        """Return whether its Action may be written: it must be neither linked nor a library override.

        Python is allowed to write linked Actions, and overrides of them lose the changes when the file is opened.
        """
        return self.action.is_editable and self.action.override_library is None

    def plays_in(self, animated: bpy.types.Object) -> bool:
        """Return whether an object plays the slot in its active Action: outside of strips, or in the edited strip."""
        data = animated.animation_data
        return data is not None and (data.action, data.action_slot_handle) == self.key


@dataclass(frozen=True, eq=False)
class Binding:
    """One transform that a slot animates, the same one of each of the slot's users."""

    slot: Slot
    prefix: str
    """The data path prefix from the user to the animated bone; empty for the user itself."""

    users: tuple[Transform, ...]

    curves: Curves
    """Its F-curves, updated when F-curves are added or removed."""

    @property
    def channelbag(self) -> bpy.types.ActionChannelbag:
        return existing(self.slot.channelbag)

    @property
    def name(self) -> str:
        """The name for messages: that of the first user."""
        return self.users[0].name

    @property
    def moving(self) -> Curves:
        """Its channels of location, rotation and scale, which modes act on. Others are left alone."""
        return {
            (path, index): fcurve
            for (path, index), fcurve in self.curves.items()
            if path.removeprefix(self.prefix) in WIDTHS
        }

    @property
    def keyed(self) -> list[bpy.types.FCurve]:
        """The channels in `moving` that have keys."""
        return [fcurve for fcurve in self.moving.values() if fcurve.keyframe_points]

    @property
    def is_keyed(self) -> bool:
        """Return whether it has channels of location, rotation or scale, with keys or samples."""
        return any(fcurve.keyframe_points or fcurve.sampled_points for fcurve in self.moving.values())

    def ensure_curve(self, channel: Channel) -> bpy.types.FCurve:
        """Return the F-curve of a channel; create it if there is none."""
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
    """Return the transforms that a slot moves: those with these prefixes, or all of them."""
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
    """Return the bindings of these transforms, in all slots that move them."""
    prefixes: dict[bpy.types.Object, dict[str, None]] = {}
    for transform in transforms:
        prefixes.setdefault(transform.animated, {})[transform.prefix] = None
    result = []
    for slot in slots_of(prefixes):
        desired = dict.fromkeys(prefix for user in slot.users for prefix in prefixes.get(user, ()))
        result += bindings_in_slot(slot, desired)
    return result


def bindings_in(actions: Iterable[bpy.types.Action]) -> list[Binding]:
    """Return the bindings of these Actions, one for each transform."""
    return [binding for slot in slots_in(actions) for binding in bindings_in_slot(slot)]


def bindings_for(transform: Transform) -> list[Binding]:
    """Return the bindings of a transform, without other users of the same slots: no other objects are visited."""
    slots = slots_alone(transform.animated)
    return [binding for slot in slots for binding in bindings_in_slot(slot, (transform.prefix,))]


def slots_of(objects: Iterable[bpy.types.Object]) -> list[Slot]:
    """Return the slots that move these objects, in their active Actions and in NLA strips; each slot once."""
    desired = {slot.key for obj in objects for slot in slots_alone(obj)}
    return [slot for slot in slots_in(action for action, _ in desired) if slot.key in desired]


def slots_in(actions: Iterable[bpy.types.Action]) -> list[Slot]:
    """Return the slots of these Actions that move an object.

    Slots are ordered by the names of their users, and for one user from the bottom of its NLA to the top. So any result
    that depends on the order is the same, no matter which object was edited.
    """
    actions = set(actions)
    if not actions:
        return []
    # A slot's own list of users may contain deleted objects, which crashes Blender 5.2.
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
    """Return the slots that move an object, ignoring other users of the same slots."""
    data = obj.animation_data
    if data is None:
        return []
    result: dict[tuple[bpy.types.Action, int], set[tuple[int, int] | None]] = {}
    # Some of Blender's operators leave the handle of a deleted slot behind.
    if data.action is not None and (slot := data.action_slot) is not None:
        result[data.action, slot.handle] = {None}
    for strip in strips_in(data.nla_tracks):
        if (action := strip.action) is not None and (slot := strip.action_slot) is not None:
            span = int(np.floor(strip.action_frame_start)), int(np.ceil(strip.action_frame_end))
            result.setdefault((action, slot.handle), set()).add(span)
    return [Slot(*key, (obj,), frozenset(strips)) for key, strips in result.items()]


def active_fcurves(animated: bpy.types.Object) -> Iterable[bpy.types.FCurve]:
    """Return the F-curves of an object's active slot, without visiting anything else in the file."""
    return next((slot.fcurves for slot in slots_alone(animated) if slot.plays_in(animated)), ())


def strips_in(owners: Iterable[bpy.types.NlaTrack | bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """Yield the strips in NLA tracks, including strips nested in meta strips."""
    for owner in owners:
        for strip in owner.strips:
            yield strip
            yield from strips_in((strip,))
