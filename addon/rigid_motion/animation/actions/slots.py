"""Which Action slots move something, and the F-curves in them, transform by transform.

A slot may have several users, and moves transforms of each: the object itself, and the bones of a rig.
`bindings_in_slot` is where a slot is taken apart. What the in-betweens of bones differ in is in a second slot of the
same Action.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..transforms import (
    CONSTRAINT,
    GROUP,
    SEGMENT_PROPERTIES,
    WIDTHS,
    Channel,
    Transform,
    prefix_of,
    split_path,
    transform_in,
)

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
    def in_nla(self) -> bool:
        """Return whether a strip shows it, or stands beside it in the NLA of one of its users."""
        return any(len(user.animation_data.nla_tracks) > 0 for user in self.users)

    @property
    def is_seen_between(self) -> bool:
        """Return whether strips may show what is between the frames of its Action on whole frames of a scene."""
        return any(
            (strip.scale, strip.repeat) != (1.0, 1.0)
            or strip.use_reverse
            or strip.use_animated_time
            or not (strip.frame_start - strip.action_frame_start).is_integer()
            for user in self.users
            for strip in strips_of(user)
            if strip.action == self.action
        )

    @property
    def channelbag(self) -> bpy.types.ActionChannelbag | None:
        slot = slot_with(self.action, self.handle)
        return None if slot is None else action_get_channelbag_for_slot(self.action, slot)

    @property
    def fcurves(self) -> Iterable[bpy.types.FCurve]:
        return () if (channelbag := self.channelbag) is None else channelbag.fcurves

    @property
    def differences(self) -> int:
        """The handle of the slot that the differences of bones are in, 0 where there is none yet."""
        pairs = self.action.rigid_motion.bone_slots
        return next((pair.differences for pair in pairs if pair.handle == self.handle), 0)

    @property
    def bones_channelbag(self) -> bpy.types.ActionChannelbag | None:
        """The channelbag with the differences of bones: of the slot that goes with this one."""
        slot = slot_with(self.action, self.differences)
        return None if slot is None else action_get_channelbag_for_slot(self.action, slot)

    @property
    def records(self) -> Iterator[bpy.types.PropertyGroup]:
        """What its Action keeps of what it moves."""
        return (record for record in self.action.rigid_motion.slots if record.handle == self.handle)

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
        """Its F-curves, those that in-betweens are in among them; looked for when they are first asked for."""
        return self.find()[self.prefix]

    @property
    def kind(self) -> type[Transform]:
        return type(self.users[0])

    @property
    def name(self) -> str:
        """The name for messages: that of its first user."""
        return self.users[0].name

    @property
    def group(self) -> str:
        """The name of the group of in-betweens, and of channels of modes and turns."""
        return self.kind.difference_group(self.prefix)

    @property
    def home(self) -> bpy.types.ActionChannelbag | None:
        """The channelbag that in-betweens are in, or are to be in."""
        return self.slot.bones_channelbag if self.kind.has_difference_slot else self.channelbag

    @cached_property
    def filled(self) -> Curves:
        """The F-curves that in-betweens are in. Who writes them sets it anew."""
        channelbag, apart = self.home, self.kind.has_difference_slot
        group = None if channelbag is None else channelbag.groups.get(self.group)
        if group is None:
            return {}
        is_own = {self.prefix + prop for prop in WIDTHS}.__contains__ if apart else _is_difference
        return {
            (path, fcurve.array_index): fcurve
            for fcurve in group.channels
            if not fcurve.keyframe_points and is_own(path := fcurve.data_path)
        }

    @property
    def is_keyed(self) -> bool:
        """Return whether it has channels of location, rotation or scale."""
        return any(path.removeprefix(self.prefix) in WIDTHS for path, _ in self.curves)

    def has_filled(self, curves: Curves) -> None:
        """Take note of the F-curves that in-betweens are in by now."""
        self.__dict__["filled"] = curves

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
        if prefix in curves or prop in WIDTHS or prop in SEGMENT_PROPERTIES or prop.startswith(_TIMES):
            curves.setdefault(prefix, {})[path, fcurve.array_index] = fcurve
    for record in slot.records:
        curves.setdefault(record.prefix, {})
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


_TIMES = f'constraints["{CONSTRAINT}'
"""The beginning of the paths of channels that say at what time constraints of ours are."""


def _users_of(slot: Slot, prefix: str) -> tuple[Transform, ...]:
    """Return what a prefix stands for in each of the users of a slot that has it."""
    users = tuple(user for obj in slot.users if (user := transform_in(obj, prefix)) is not None)
    return users[0].together(users) if users else ()


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


def filled_bindings(obj: bpy.types.Object) -> list[Binding]:
    """Return what is filled in of all that an object's Actions move of it, as if nothing else used the same slots."""
    result = []
    for slot in slots_alone(obj):
        channelbag = slot.bones_channelbag
        bones = () if channelbag is None else map(prefix_of, channelbag.groups.keys())
        result += [binding for binding in bindings_in_slot(slot, {"", *bones}) if binding.filled]
    return result


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


def actions_of(animated: bpy.types.ID) -> Iterator[bpy.types.Action]:
    """Yield the Actions that move something, by themselves and in strips."""
    data = animated.animation_data
    if data is not None:
        if data.action is not None:
            yield data.action
        if len(data.nla_tracks):
            yield from (strip.action for strip in strips_of(animated) if strip.action is not None)


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


def handles_of_differences(action: bpy.types.Action) -> set[int]:
    """Return the handles of the slots that differences of bones are in."""
    return {pair.differences for pair in action.rigid_motion.bone_slots}


def counterpart_in(action: bpy.types.Action, slot: bpy.types.ActionSlot) -> bpy.types.ActionSlot | None:
    """Return the same slot in a copy of an Action, or in the original: by its name, or renamed by its handle."""
    return action.slots.get(slot.identifier) or slot_with(action, slot.handle)


def in_action(action: bpy.types.Action, slot: Slot) -> Slot | None:
    """Return the same slot in a copy of its Action, or in the original. None where it was taken out of it."""
    result = counterpart_in(action, slot_with(*slot.key))
    return None if result is None else replace(slot, action=action, handle=result.handle)


def strips_of(obj: bpy.types.Object) -> Iterator[bpy.types.NlaStrip]:
    """Return the strips in the NLA of an object, those in strips of strips among them."""
    return with_inner_strips(strip for track in obj.animation_data.nla_tracks for strip in track.strips)


def with_inner_strips(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """Yield strips, and those in strips of strips."""
    for strip in strips:
        yield strip
        yield from with_inner_strips(strip.strips)


def choose_slots(obj: bpy.types.Object) -> None:
    """Have strips show the only slot with keys that they can, as Blender does where an Action has no differences in it.

    A strip that was made to show none remembers which one it showed.
    """
    data = obj.animation_data
    for track in data.nla_tracks if data is not None else ():
        for strip in track.strips:
            if (slot := _slot_to_choose(strip)) is not None:
                is_new = not strip.last_slot_identifier
                strip.action_slot = slot
                if is_new:
                    _give_length(strip, track, slot)


def _slot_to_choose(strip: bpy.types.NlaStrip) -> bpy.types.ActionSlot | None:
    action = strip.action
    if action is None or strip.action_slot_handle or strip.last_slot_identifier in action.slots:
        return None
    differences = handles_of_differences(action)
    keyed = [slot for slot in strip.action_suitable_slots if slot.handle not in differences]
    return keyed[0] if differences and len(keyed) == 1 else None


def _give_length(strip: bpy.types.NlaStrip, track: bpy.types.NlaTrack, slot: bpy.types.ActionSlot) -> None:
    """Have a strip show all of its Action, up to the next strip: Blender makes those without a slot one frame long."""
    if (strip.action_frame_start, strip.action_frame_end) != (0.0, 1.0):
        return
    channelbag = action_get_channelbag_for_slot(strip.action, slot)
    keyed = [fcurve.range() for fcurve in channelbag.fcurves if len(fcurve.keyframe_points)] if channelbag else []
    if strip.action.use_frame_range or not keyed:
        first, last = strip.action.frame_range
    else:
        # Differences may lie behind the keys.
        first, last = min(begin for begin, _ in keyed), max(end for _, end in keyed)
    room = min((item.frame_start for item in track.strips if item.frame_start > strip.frame_start), default=math.inf)
    strip.action_frame_end = min(last, first + room - strip.frame_start)
    strip.action_frame_start = first


def is_filled_in(fcurve: bpy.types.FCurve) -> bool:
    """Return whether an F-curve is one that in-betweens of an object are in: without keys, and in the group of them."""
    group = fcurve.group
    is_in_group = group is not None and group.name == GROUP
    return is_in_group and not fcurve.keyframe_points and _is_difference(fcurve.data_path)


def _is_difference(path: str) -> bool:
    """Return whether a data path is that of a delta transform."""
    return path.startswith("delta_")


def is_time(fcurve: bpy.types.FCurve) -> bool:
    """Return whether an F-curve says at what time a constraint of ours is."""
    return split_path(fcurve.data_path)[1].startswith(_TIMES)
