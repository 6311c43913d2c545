"""Which Action slots move an object, and the F-curves in them.

Objects are what can be filled in. A pose bone has its channels in its armature's Action, under a prefix of its own, and
no delta transforms: `Transformable` is where it will come in, for what is baked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..motion.eulers import ORDERS
from .sources import LOCATION, ROTATION, ROWS, SCALE

MODE_PATH = "rigid_motion.mode"

GROUP = "Rigid Motion"
"""The group of F-curves that the mode channel and the delta transforms are in."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, SCALE: 3}

Curves = dict[tuple[str, int], bpy.types.FCurve]


class Refused(ValueError):
    """Why rigid motion cannot act on something: names it, and the way out."""


@dataclass(frozen=True)
class Transformable:
    """What has location, rotation and scale, told apart from the object whose Action holds the channels."""

    animated: bpy.types.Object
    carrier: bpy.types.Object | bpy.types.PoseBone
    prefix: str = ""
    """From the object to the carrier, in data paths."""

    @classmethod
    def of(cls, obj: bpy.types.Object) -> Transformable:
        return cls(obj, obj)

    @property
    def name(self) -> str:
        return self.carrier.name

    @property
    def rotation(self) -> str:
        """The property that turns it. `Refused` where that is an axis and an angle."""
        mode = self.carrier.rotation_mode
        if mode == "QUATERNION":
            return "rotation_quaternion"
        if mode in ORDERS:
            return "rotation_euler"
        raise Refused(
            f"{self.name} turns by axis and angle, which has no rigid in-betweens: "
            "set its rotation mode to Quaternion first (sidebar, Item)"
        )

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return _properties(self.rotation)

    @property
    def channels(self) -> dict[int, tuple[str, int]]:
        """Data path and index of each of its components, by their rows."""
        return _channels(self.prefix, self.rotation)

    @property
    def deltas(self) -> dict[int, tuple[str, int]]:
        """The same of its delta transforms."""
        return _channels(f"{self.prefix}delta_", self.rotation)


def _properties(rotation: str) -> dict[str, str]:
    return {LOCATION: "location", ROTATION: rotation, SCALE: "scale"}


@cache
def _channels(prefix: str, rotation: str) -> dict[int, tuple[str, int]]:
    return {
        ROWS[name].start + index: (prefix + prop, index)
        for name, prop in _properties(rotation).items()
        for index in range(WIDTHS[prop])
    }


@dataclass(frozen=True)
class Slot:
    """One of the slots that move an object, with everything else that it moves."""

    action: bpy.types.Action
    handle: int
    users: tuple[bpy.types.Object, ...]
    strips: frozenset[tuple[int, int] | None]
    """The frames of the Action that strips show; None where it plays by itself."""

    @property
    def span(self) -> tuple[int, int]:
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


def slots_of(objects: Iterable[bpy.types.Object]) -> list[Slot]:
    """The slots that move these objects, in Actions of their own and in NLA strips; each once."""
    known = {obj: _uses(obj) for obj in objects}
    wanted = {key for uses in known.values() for key in uses}
    return _slots(lambda key: key in wanted, known) if wanted else []


def slots_in(actions: Iterable[bpy.types.Action]) -> list[Slot]:
    """The slots of these Actions that move an object."""
    wanted = {action.as_pointer() for action in actions}
    return _slots(lambda key: key[0] in wanted, {})


def _slots(is_wanted: Callable[[tuple[int, int]], bool], known: Mapping[bpy.types.Object, Uses]) -> list[Slot]:
    users: dict[tuple[int, int], list[bpy.types.Object]] = {}
    places = {}
    for obj in bpy.data.objects:
        for key, (action, handle, strips) in (known[obj] if obj in known else _uses(obj)).items():
            if is_wanted(key):
                users.setdefault(key, []).append(obj)
                places.setdefault(key, (action, handle, set()))[2].update(strips)
    return [
        Slot(action, handle, tuple(users[key]), frozenset(strips)) for key, (action, handle, strips) in places.items()
    ]


Uses = dict[tuple[int, int], tuple[bpy.types.Action, int, set[tuple[int, int] | None]]]
"""The slots that move an object: Action, handle, and the frames that strips show, None outside of the NLA."""


def _uses(obj: bpy.types.Object) -> Uses:
    data = obj.animation_data
    if data is None:
        return {}
    found = {}
    action = data.action
    if action is not None and (handle := data.action_slot_handle):
        found[action.as_pointer(), handle] = (action, handle, {None})
    if len(data.nla_tracks):
        for strip in _strips(strip for track in data.nla_tracks for strip in track.strips):
            if (action := strip.action) is not None and (handle := strip.action_slot_handle):
                span = int(np.floor(strip.action_frame_start)), int(np.ceil(strip.action_frame_end))
                found.setdefault((action.as_pointer(), handle), (action, handle, set()))[2].add(span)
    return found


def _strips(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    for strip in strips:
        yield strip
        yield from _strips(strip.strips)


def is_replacing(obj: bpy.types.Object, slot: Slot) -> bool:
    """Whether a slot, wherever it moves an object in the NLA, takes the place of what is below it: nothing is added."""
    data = obj.animation_data
    if data.action == slot.action and data.action_blend_type != "REPLACE":
        return False
    # Without an Action it is a strip of strips, and these may be in it.
    strips = _strips(strip for track in data.nla_tracks for strip in track.strips)
    return all(strip.blend_type == "REPLACE" for strip in strips if strip.action in (None, slot.action))


def curves_in(channelbag: bpy.types.ActionChannelbag | None) -> Curves:
    """The F-curves of a slot, by data path and index."""
    if channelbag is None:
        return {}
    return {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in channelbag.fcurves}


def is_filled_in(fcurve: bpy.types.FCurve) -> bool:
    """Whether an F-curve is one that in-betweens are in: sampled, and in the group of them."""
    group = fcurve.group
    return group is not None and group.name == GROUP and not fcurve.keyframe_points
