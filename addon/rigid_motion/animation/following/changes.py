"""What Blender tells of edits, and which channels of an Action they were about.

Its dependency graphs name data-blocks that wait to be evaluated, or just were. They are found by their names, for the
original of what was deleted just now is no longer there to be asked for. Of an Action they say no more, so a snapshot
of its keys is kept and compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import bpy
import numpy as np

from ..actions.channels import KEY_FIELDS
from ..actions.slots import Slot
from ..transforms import TURNS_PROPERTY, WIDTHS, Channel, split_path

OF_OBJECTS = (
    *("rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"),
    *("delta_location", "delta_rotation_quaternion", "delta_rotation_euler", "delta_scale"),
)
"""The properties of objects that in-betweens depend on."""

BlockKey = tuple[str, str | None]
"""The key that a data-block is found by in the file: its name, and the file that it is linked from."""

OFTEN = ("co", "handle_left", "handle_right", "interpolation")
"""What of a key is edited most: it is looked at first, and the rest where nothing of it has changed."""

SELDOM = ("easing", "back", "amplitude", "period", "type")
"""What else in-betweens depend on of a key."""


def key_of(block: bpy.types.ID) -> BlockKey:
    return block.name, block.library and block.library.filepath


def edited_actions(depsgraph: bpy.types.Depsgraph | None) -> set[bpy.types.Action]:
    """Return the Actions that wait to be evaluated in a dependency graph, or just were."""
    if depsgraph is None or not depsgraph.id_type_updated("ACTION"):
        return set()
    keys = [key_of(update.id) for update in depsgraph.updates if isinstance(update.id, bpy.types.Action)]
    return set(map(bpy.data.actions.get, keys)) - {None}


def edited_objects(depsgraph: bpy.types.Depsgraph | None) -> set[bpy.types.Object]:
    """Return the objects that wait to be evaluated in a dependency graph, or just were, with the rigs of armatures."""
    if depsgraph is None or not (depsgraph.id_type_updated("OBJECT") or depsgraph.id_type_updated("ARMATURE")):
        return set()
    updates = [update.id for update in depsgraph.updates]
    keys = [key_of(block) for block in updates if isinstance(block, bpy.types.Object)]
    result = set(map(bpy.data.objects.get, keys)) - {None}
    # A setting of a bone at rest is the armature's alone, until that was evaluated.
    alone = {key_of(block) for block in updates if isinstance(block, bpy.types.Armature)}
    alone -= {key_of(obj.data) for obj in result if obj.type == "ARMATURE"}
    if alone:
        result |= {obj for obj in bpy.data.objects if obj.type == "ARMATURE" and key_of(obj.data) in alone}
    return result


def add_action(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, added: set[tuple[int, int]]) -> None:
    """Have the Action of an object be in the dependency graph, which otherwise does not tell of its edits.

    Blender leaves one out that *Make Single User > Object Animation* has made. `added` has the session ids of objects
    and Actions that this was tried for.
    """
    action = None if obj.animation_data is None else obj.animation_data.action
    key = None if action is None else (obj.session_uid, action.session_uid)
    if key is not None and key not in added and not action.evaluated_get(depsgraph).is_evaluated:
        added.add(key)
        # No edit, but Blender finds out anew what depends on what.
        obj.instance_type = obj.instance_type


def graphs_of(scene: bpy.types.Scene) -> Iterator[bpy.types.Depsgraph | None]:
    return (layer.depsgraph for layer in scene.view_layers)


class _Reader:
    """Reads these properties of the keys of many F-curves, into memory that it keeps."""

    def __init__(self, names: Sequence[str]) -> None:
        self._kinds = {name: (width * np.dtype(kind).itemsize, kind) for name, (width, kind) in KEY_FIELDS.items()}
        self._names = names
        self._counts: list[int] = []
        self._buffer, self._views, self._bounds = np.empty(0, np.uint8), [], [0]

    def read(self, curves: Iterable[bpy.types.FCurve], counts: list[int]) -> list[bytes]:
        """Return what the keys of F-curves have, of which each has so many."""
        if counts != self._counts:
            self._make_room(counts)
        for fcurve, views in zip(curves, self._views, strict=True):
            points = fcurve.keyframe_points
            for name, view in zip(self._names, views, strict=True):
                points.foreach_get(name, view)
        raw = self._buffer.tobytes()
        return [raw[begin:end] for begin, end in pairwise(self._bounds)]

    def _make_room(self, counts: list[int]) -> None:
        sizes = sum(self._kinds[name][0] for name in self._names)
        self._counts, self._bounds = counts, [0, *np.cumsum(np.array(counts) * sizes).tolist()]
        self._buffer, self._views = np.zeros(self._bounds[-1], np.uint8), []
        for count, at in zip(counts, self._bounds, strict=False):
            views = []
            for size, kind in (self._kinds[name] for name in self._names):
                views.append(self._buffer[at : at + count * size].view(kind))
                at += count * size
            self._views.append(views)


class Snapshot:
    """The keys of a slot as they were when it was looked at last."""

    def __init__(self, slot: Slot) -> None:
        self._often, self._seldom = _Reader(OFTEN), _Reader(SELDOM)
        curves = _curves_in(slot)
        flags = list(map(_flags_of, curves.values()))
        counts = [count for count, *_ in flags]
        self._shown = dict(zip(curves, zip(flags, self._often.read(curves.values(), counts), strict=True), strict=True))
        self._rest = dict(zip(curves, self._seldom.read(curves.values(), counts), strict=True))

    def look(self, slot: Slot) -> set[Channel]:
        """Look at a slot again, and return the F-curves that are other than before, or not there before or now."""
        curves = _curves_in(slot)
        flags = list(map(_flags_of, curves.values()))
        counts = [count for count, *_ in flags]
        before, of_keys = self._shown, self._often.read(curves.values(), counts)
        self._shown = dict(zip(curves, zip(flags, of_keys, strict=True), strict=True))
        changed = _differing(before, self._shown)
        if not changed:
            rest = self._rest
            self._rest = dict(zip(curves, self._seldom.read(curves.values(), counts), strict=True))
            changed = _differing(rest, self._rest)
        return changed

    def note_modifiers(self, curves: Mapping[Channel, bpy.types.FCurve]) -> bool:
        """Take note of the modifiers that these F-curves have by now.

        Returns whether they are those that there were, with as many keys.
        """
        flags = {channel: _flags_of(fcurve) for channel, fcurve in curves.items() if _matters(channel[0])}
        if any(channel not in self._shown or self._shown[channel][0][0] != now[0] for channel, now in flags.items()):
            return False
        self._shown |= {channel: (now, self._shown[channel][1]) for channel, now in flags.items()}
        return True


def _differing(before: Mapping[Channel, object], now: Mapping[Channel, object]) -> set[Channel]:
    return {channel for channel, one in now.items() if before.get(channel) != one} | (before.keys() - now.keys())


def _curves_in(slot: Slot) -> dict[Channel, bpy.types.FCurve]:
    """Return the F-curves of a slot that in-betweens depend on."""
    curves = ((fcurve.data_path, fcurve) for fcurve in slot.fcurves)
    return {(path, fcurve.array_index): fcurve for path, fcurve in curves if _matters(path)}


@lru_cache(maxsize=65536)
def _matters(path: str) -> bool:
    prop = split_path(path)[1]
    return prop in WIDTHS or prop == TURNS_PROPERTY


def _flags_of(fcurve: bpy.types.FCurve) -> tuple[int, int, bool, bool]:
    """Return the number of keys and of modifiers, whether it is muted, and whether it goes on at its slope."""
    is_linear = fcurve.extrapolation == "LINEAR"
    return len(fcurve.keyframe_points), len(fcurve.modifiers), fcurve.mute, is_linear


def bones_in(rig: bpy.types.Object) -> np.ndarray:
    """Return what in-betweens depend on of the bones of a rig beside their keys, a row each: how they turn, what
    rotation and scale they have, and whether they move along the axes of their parents.
    """
    bones, data = rig.pose.bones, rig.data.bones
    columns = []
    for name, width in {**WIDTHS, "rotation_mode": 0}.items():
        values = np.empty(len(bones) * max(width, 1), np.float32 if width else np.int32)
        bones.foreach_get(name, values)
        columns.append(values.view(np.int32).reshape(len(bones), -1))
    is_local = np.empty(len(data), bool)
    data.foreach_get("use_local_location", is_local)
    at_rest = np.empty((len(data), 16), np.float32)
    if not is_local.all():
        data.foreach_get("matrix_local", at_rest.ravel())
    else:
        at_rest[:] = 0.0
    if len(data) != len(bones):  # It is being edited.
        return np.column_stack(columns[1:])
    return np.column_stack((*columns[1:], is_local, at_rest.view(np.int32)))


def object_bits(obj: bpy.types.Object) -> tuple:
    """Return what in-betweens of an object depend on beside its keys."""
    data = obj.animation_data
    values = [tuple(getattr(obj, name)) for name in OF_OBJECTS]
    if data is None:
        return obj.rotation_mode, *values
    strips = [
        (
            track.mute,
            strip.mute,
            strip.action,
            strip.action_slot_handle,
            strip.action_frame_start,
            strip.action_frame_end,
        )
        for track in data.nla_tracks
        for strip in track.strips
    ]
    return obj.rotation_mode, *values, data.action, data.action_slot_handle, len(data.drivers), *strips


def slots_by(bits: tuple) -> set[tuple[bpy.types.Action, int]]:
    """Return the Actions that move an object by its `object_bits`, each with the handle of a slot."""
    own, strips = bits[1 + len(OF_OBJECTS) :][:2], bits[4 + len(OF_OBJECTS) :]
    return {pair for pair in (own, *(strip[2:4] for strip in strips)) if pair and pair[0] is not None}
