"""Snapshots of rigs: which of their many bones an edit was about.

Blender tells that an Action or an object was edited, and no more. To read all channels of a rig after every edit of one
of them takes longer than all the rest, so a snapshot of them is kept, as bytes, and compared. A change that means
nothing, of what is selected for example, counts too: whether in-betweens depend on it the digest tells.

Blender offers no way to get at all of a key at once: property by property it takes four times as long as to read the
memory that the keys are in. How much memory a key takes and what is where in it Blender promises nowhere, so the first
F-curves that come are read in both ways. Where these disagree, all keys are read by Blender's own functions from then
on, for as long as the process lives.
"""

from __future__ import annotations

import itertools
import logging
import operator
from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import bpy
import numpy as np

from ..actions.channels import key_fields
from ..actions.slots import (
    Binding,
    Curves,
    Slot,
    active_fcurves,
    bindings_in_slot,
    bindings_with,
    slots_alone,
    slots_in,
    slots_of,
)
from ..transforms import WIDTHS, Channel, prefix_of, shows_differences, split_path

log = logging.getLogger(__package__)

Channels = Sequence[bpy.types.bpy_prop_collection]
"""`keyframe_points` of F-curves."""

POINTS = {"handle_left": slice(0, 2), "co": slice(3, 5), "handle_right": slice(6, 8)}
"""The places of a key's points in its memory, counted in single-precision numbers: behind each is an unused one."""

NUMBERS = 9
"""The number of numbers that a key begins with."""

_COLUMNS = [(prop, index) for prop, width in WIDTHS.items() for index in range(width)]
"""The properties of a bone, in the order of the columns of `property_bits`."""

SAME_VALUE = 1e-6
"""The distance of a property from its channel, relative or absolute below 1, that is single precision."""


class _Layout:
    """What is known of the memory of keys."""

    size: int | None = None
    """The bytes that a key takes. None as long as no two of one F-curve were seen, 0 where it is not as expected."""


def read_keys(channels: Channels) -> list[bytes]:
    """Return the bytes of each channel's keys.

    They differ wherever anything of a key differs, selection included, and also where they were read in the other way.
    """
    if _Layout.size is None:
        _Layout.size = _checked_size(channels)
    size = _Layout.size
    if not size:
        return [b"".join(numbers.tobytes() for numbers in key_fields(keys).values()) for keys in channels]
    return [_view(keys[0].as_pointer(), size * count).tobytes() if (count := len(keys)) else b"" for keys in channels]


def _checked_size(channels: Channels) -> int | None:
    """Return how many bytes a key takes: see `_Layout.size`."""
    several = [keys for keys in channels if len(keys) > 1]
    if not several:
        return None
    size = several[0][1].as_pointer() - several[0][0].as_pointer()
    if all(_agrees(keys, size) for keys in several):
        return size
    log.warning("Keys are not in memory as expected, and are read by Blender's own functions, which takes longer")
    return 0


def _agrees(keys: bpy.types.bpy_prop_collection, size: int) -> bool:
    """Return whether memory has the same keys as Blender says, one behind the other and each of so many bytes."""
    count, first = len(keys), keys[0].as_pointer()
    if size < 4 * NUMBERS or size % 4 or keys[count - 1].as_pointer() - first != size * (count - 1):
        return False
    numbers = _view(first, size * count).view(np.int32).reshape(count, -1)
    fields = key_fields(keys)
    return all(np.array_equal(numbers[:, columns], fields[name].view(np.int32)) for name, columns in POINTS.items())


class _Memory:
    """A stretch of memory that NumPy can read."""

    __array_interface__: dict[str, object]


@lru_cache(maxsize=65536)
def _view(address: int, size: int) -> np.ndarray:
    """Return what is in memory there, whenever it is looked at."""
    memory = _Memory()
    memory.__array_interface__ = {"data": (address, True), "shape": (size,), "typestr": "|u1", "version": 3}
    return np.asarray(memory)


class Snapshots:
    """The last snapshots of the slots and the rigs in a file."""

    def __init__(self) -> None:
        self._slots: dict[tuple[int, int], _SlotSnapshot] = {}
        """By the Action's session id, and the slot's handle."""
        self._rigs: dict[int, tuple[_Dependencies, _Poses, float]] = {}
        """For each rig what all its bones depend on, what they were, and on which frame, by its session id."""

    def clear(self) -> None:
        """Take all for changed the next time."""
        self._slots.clear()
        self._rigs.clear()

    def edited_in(self, slot: Slot) -> list[Binding]:
        """Return what of all that a slot moves has other channels than before; everything where there is no telling."""
        if all(user.pose is None for user in slot.users):
            return bindings_in_slot(slot)
        channelbag, key = slot.channelbag, (slot.action.session_uid, slot.handle)
        if channelbag is None:
            self._slots.pop(key, None)
            return bindings_in_slot(slot)
        snapshot = self._slots.get(key)
        if snapshot is None or not snapshot.is_of(channelbag):
            self._slots[key] = _SlotSnapshot(channelbag)
            return bindings_in_slot(slot)
        changed = dict.fromkeys(snapshot.prefixes[number] for number in sorted(snapshot.update()))
        return bindings_with(slot, channelbag, {prefix: snapshot.curves_under(prefix) for prefix in changed})

    def changed_bones(self, rig: bpy.types.Object, frame: float, *, is_set: bool = True) -> list[bpy.types.PoseBone]:
        """Return the bones of a rig that are other than before: how they are posed, or what moves them.

        Along with them those of other rigs that move by slots which this one has left.

        Where another frame is shown than before, those do not count that are where the rig's Action has them. Settings
        take longest to be read: they are where something of the rig itself `is_set`, not of its Action alone.
        """
        before = self._rigs.get(rig.session_uid)
        now, bones = _Poses(rig, None if is_set or before is None else before[1]), rig.pose.bones
        shared = _Dependencies.of(rig)
        self._rigs[rig.session_uid] = shared, now, frame
        if before is None or shared != before[0] or before[1].names != now.names:
            left = set() if before is None else dict(before[0].moved_by).keys() - dict(shared.moved_by).keys()
            return [*bones, *(bone for other in _users_of(left) for bone in other.pose.bones)]
        changed = now.changed_from(before[1])
        if changed and before[2] != frame:
            changed = now.posed_since(before[1], changed, active_fcurves(rig), frame)
        return [bones[number] for number in changed]


class _SlotSnapshot:
    """The F-curves of a slot, and what they had."""

    def __init__(self, channelbag: bpy.types.ActionChannelbag) -> None:
        self.channelbag, self.address = channelbag, channelbag.as_pointer()
        self.fcurves = list(channelbag.fcurves)
        self.paths = [fcurve.data_path for fcurve in self.fcurves]
        self.prefixes, properties = zip(*map(split_path, self.paths), strict=True) if self.paths else ((), ())
        self.under: defaultdict[str, list[int]] = defaultdict(list)
        """The numbers of the F-curves by what their data paths begin with."""
        for number, prefix in enumerate(self.prefixes):
            self.under[prefix].append(number)
        self.channels = [fcurve.keyframe_points for fcurve in self.fcurves]
        self.modifiers = [
            fcurve.modifiers if prop in WIDTHS else () for fcurve, prop in zip(self.fcurves, properties, strict=True)
        ]
        self.flags, self.keys, self.modified = self._flags(), read_keys(self.channels), self._modified()

    def is_of(self, channelbag: bpy.types.ActionChannelbag) -> bool:
        """Return whether these are still the F-curves that there are, under the same data paths."""
        fcurves = list(channelbag.fcurves)
        return (
            self.address == channelbag.as_pointer()
            and self.fcurves == fcurves
            and self.paths == [fcurve.data_path for fcurve in fcurves]
        )

    def update(self) -> set[int]:
        """Take another snapshot: the numbers of those that may have something else than before."""
        flags, keys, modified = self.flags, self.keys, self.modified
        self.flags, self.keys, self.modified = self._flags(), read_keys(self.channels), self._modified()
        changed = {*modified, *self.modified, *np.flatnonzero((self.flags != flags).any(axis=0)).tolist()}
        if self.keys != keys:
            changed.update(itertools.compress(itertools.count(), map(operator.ne, self.keys, keys)))
        return changed

    def curves_under(self, prefix: str) -> Curves:
        """Return the F-curves whose data paths begin so."""
        indices = self.flags[-1]
        return {(self.paths[number], int(indices[number])): self.fcurves[number] for number in self.under[prefix]}

    def _modified(self) -> list[int]:
        """Return the numbers of those that have modifiers, which may have changed for all that can be seen here."""
        return [number for number, modifiers in enumerate(self.modifiers) if len(modifiers)]

    def _flags(self) -> np.ndarray:
        """Return whether each F-curve is muted, how it goes on outside of its keys, and its index, shape (3, n)."""
        flags = np.empty((3, len(self.fcurves)), np.int32)
        for row, name in zip(flags, ("mute", "extrapolation", "array_index"), strict=True):
            self.channelbag.fcurves.foreach_get(name, row)
        return flags


def property_bits(rig: bpy.types.Object) -> np.ndarray:
    """Return the properties of bones bit by bit, in `_COLUMNS`, and their rotation modes behind, (bones, columns)."""
    bones, columns = rig.pose.bones, []
    for name, width in WIDTHS.items():
        values = np.empty(len(bones) * width, np.float32)
        bones.foreach_get(name, values)
        columns.append(values.view(np.int32).reshape(len(bones), width))
    modes = np.empty(len(bones), np.int32)
    bones.foreach_get("rotation_mode", modes)
    return np.column_stack((*columns, modes))


class _Poses:
    """All about the bones of a rig that in-betweens may depend on, but for their channels."""

    def __init__(self, rig: bpy.types.Object, as_in: _Poses | None) -> None:
        """Take a snapshot. Settings are those of an earlier snapshot, `as_in`, where that is of the same bones."""
        bones = rig.pose.bones
        self.names, self.numbers = bones.keys(), property_bits(rig)
        is_known = as_in is not None and as_in.names == self.names
        self.settings = as_in.settings if is_known else [_settings_of(bone) for bone in bones]

    def changed_from(self, before: _Poses) -> list[int]:
        """Return the numbers of the bones, the same ones, that were otherwise before."""
        moved = (self.numbers != before.numbers).any(axis=1).tolist()
        return [
            number
            for number, (is_moved, now, then) in enumerate(zip(moved, self.settings, before.settings, strict=True))
            if is_moved or now != then
        ]

    def posed_since(
        self, before: _Poses, numbers: list[int], fcurves: Iterable[bpy.types.FCurve], frame: float
    ) -> list[int]:
        """Return those of some bones that are not merely where their channels have them on another frame."""
        posed = {number for number in numbers if self.settings[number] != before.settings[number]}
        moved: dict[Channel, tuple[int, float]] = {}
        for number, column in np.argwhere(self.numbers != before.numbers).tolist():
            if column == len(_COLUMNS):
                posed.add(number)
            else:
                prop, index = _COLUMNS[column]
                value = float(self.numbers[number, column : column + 1].view(np.float32)[0])
                moved[prefix_of(self.names[number]) + prop, index] = number, value
        for fcurve in fcurves if moved else ():
            channel = fcurve.data_path, fcurve.array_index
            if channel in moved and not fcurve.mute:
                _, value = moved[channel]
                if abs(fcurve.evaluate(frame) - value) <= SAME_VALUE * max(1.0, abs(value)):
                    del moved[channel]
        posed |= {number for number, _ in moved.values()}
        return [number for number in numbers if number in posed]


def _settings_of(bone: bpy.types.PoseBone) -> tuple:
    motion = bone.rigid_motion
    shown_by = [(one.name, one.mute) for one in bone.constraints if shows_differences(one)]
    return motion.mode, motion.awaited, motion.mounted, shown_by


class _Dependencies(NamedTuple):
    """What all bones of a rig depend on."""

    moved_by: list[tuple[tuple[int, int], list[str]]]
    """The slots, and the strips that show them."""

    users: list[tuple]
    """The users of each slot, and whether any of them has an NLA."""

    rest: bytes

    @classmethod
    def of(cls, rig: bpy.types.Object) -> _Dependencies:
        alone = slots_alone(rig)
        moved_by = [((slot.action.as_pointer(), slot.handle), sorted(map(str, slot.strips))) for slot in alone]
        users = [(slot.in_nla, *(user.session_uid for user in slot.users)) for slot in slots_of([rig])]
        return cls(moved_by, users, _rest_of(rig.data.bones))


def _users_of(keys: set[tuple[int, int]]) -> set[bpy.types.Object]:
    """Return the rigs that slots move: given by the addresses of their Actions, and their handles."""
    addresses = {address for address, _ in keys}
    actions = [action for action in bpy.data.actions if action.as_pointer() in addresses] if keys else ()
    slots = [slot for slot in slots_in(actions) if (slot.action.as_pointer(), slot.handle) in keys]
    return {user for slot in slots for user in slot.users if user.pose is not None}


def _rest_of(bones: bpy.types.ArmatureBones) -> bytes:
    """Return how bones are at rest, as far as it matters: for the axes of locations that are not the bone's own."""
    is_local = np.empty(len(bones), bool)
    bones.foreach_get("use_local_location", is_local)
    if is_local.all():
        return b""
    at_rest = np.empty((len(bones), 16), np.float32)
    bones.foreach_get("matrix_local", at_rest.ravel())
    return is_local.tobytes() + at_rest.tobytes()
