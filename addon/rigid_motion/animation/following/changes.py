"""What Blender tells of edits, and which channels of an Action they were about.

Its dependency graphs name data-blocks that wait to be evaluated, or just were. They are found by their names
alone, for of what was deleted just now neither the original nor its library is there to be asked for. Of an Action they
say no more, so a snapshot of its keys is kept and compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from ...blender import armature, pose_bones
from ..actions.channels import KEY_FIELDS
from ..actions.modifiers import settings_of_others
from ..actions.slots import Slot
from ..transforms import TURNS_PROPERTY, WIDTHS, Channel, split_path

OF_OBJECTS = (
    *("rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"),
    *("delta_location", "delta_rotation_quaternion", "delta_rotation_euler", "delta_scale"),
)
"""The properties of objects that in-betweens depend on."""

OFTEN_CHANGED = ("co", "handle_left", "handle_right")
"""What of keys is dragged: it is looked at first."""

SELDOM_CHANGED = (
    *("interpolation", "easing", "back", "amplitude", "period", "type"),
    *("handle_left_type", "handle_right_type"),
)
"""What else in-betweens depend on of keys."""


def edited_actions(*graphs: bpy.types.Depsgraph) -> set[bpy.types.Action]:
    """Return the Actions that wait to be evaluated in dependency graphs, or just were."""
    updates = [update.id for graph in graphs if graph.id_type_updated("ACTION") for update in graph.updates]
    return _originals(bpy.data.actions, [block for block in updates if isinstance(block, bpy.types.Action)])


def edited_objects(*graphs: bpy.types.Depsgraph) -> set[bpy.types.Object]:
    """Return the objects that wait to be evaluated in dependency graphs, or just were, with the rigs of armatures."""
    edited = (graph for graph in graphs if graph.id_type_updated("OBJECT") or graph.id_type_updated("ARMATURE"))
    updates = [update.id for graph in edited for update in graph.updates]
    result = _originals(bpy.data.objects, [block for block in updates if isinstance(block, bpy.types.Object)])
    # A setting of a bone at rest is the armature's alone, until that was evaluated.
    alone = {block.name for block in updates if isinstance(block, bpy.types.Armature)}
    alone -= {armature(obj).name for obj in result if obj.type == "ARMATURE"}
    if alone:
        result |= {obj for obj in bpy.data.objects if obj.type == "ARMATURE" and armature(obj).name in alone}
    return result


def _originals(present: Any, blocks: Iterable[bpy.types.ID]) -> set:
    """Return those present in the file that these are evaluated copies of; linked ones of the same names with them."""
    names = {block.name for block in blocks}
    keys = [*names, *((name, library.filepath) for library in bpy.data.libraries for name in names)]
    return set(map(present.get, keys)) - {None}


def add_action(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, added: set[tuple[int, int]]) -> None:
    """Have the Action of an object be in the dependency graph, which otherwise does not tell of its edits.

    Blender leaves one out that *Make Single User > Object Animation* has made. `added` has the session ids of objects
    and Actions that this was tried for.
    """
    action = None if obj.animation_data is None else obj.animation_data.action
    if action is None or (key := (obj.session_uid, action.session_uid)) in added:
        return
    if not action.evaluated_get(depsgraph).is_evaluated:
        added.add(key)
        # No edit, but Blender finds out anew what depends on what.
        obj.instance_type = obj.instance_type


def graphs_of(scene: bpy.types.Scene) -> list[bpy.types.Depsgraph]:
    return [layer.depsgraph for layer in scene.view_layers if layer.depsgraph is not None]


class Snapshot:
    """The keys of a slot as they were when it was looked at last."""

    def __init__(self, slot: Slot) -> None:
        curves = _curves_in(slot)
        self._often, self._seldom = _often_in(curves), _seldom_in(curves)

    def look(self, slot: Slot) -> set[Channel]:
        """Look at a slot again, and return the F-curves that are other than before, or not there before or now."""
        curves = _curves_in(slot)
        often = _often_in(curves)
        changed, self._often = _differing(self._often, often), often
        # Of one transform an edit is of this. Of several, or of none so far, others may have got other marks.
        if len({split_path(path)[0] for path, _ in changed}) != 1:
            seldom = _seldom_in(curves)
            changed |= _differing(self._seldom, seldom)
            self._seldom = seldom
        return changed

    def note(self, curves: Mapping[Channel, bpy.types.FCurve]) -> None:
        """Take note of what these F-curves have by now, so that it is no change later."""
        curves = {channel: fcurve for channel, fcurve in curves.items() if _matters(channel[0])}
        self._often |= _often_in(curves)
        self._seldom |= _seldom_in(curves)


def _differing(before: Mapping[Channel, object], now: Mapping[Channel, object]) -> set[Channel]:
    return {channel for channel, one in now.items() if before.get(channel) != one} | (before.keys() - now.keys())


def _curves_in(slot: Slot) -> dict[Channel, bpy.types.FCurve]:
    """Return the F-curves of a slot that in-betweens depend on."""
    curves = ((fcurve.data_path, fcurve) for fcurve in slot.fcurves)
    return {(path, fcurve.array_index): fcurve for path, fcurve in curves if _matters(path)}


@lru_cache(maxsize=65536)
def _matters(path: str) -> bool:
    prop = split_path(path)[1]
    return prop in WIDTHS or prop == TURNS_PROPERTY or prop.startswith("constraints[")


def _often_in(curves: Mapping[Channel, bpy.types.FCurve]) -> dict[Channel, tuple[bool, str, bytes]]:
    """Return whether F-curves are muted, how they go on, and `OFTEN_CHANGED` of their keys."""
    return {channel: (one.mute, one.extrapolation, _keys_of(one, OFTEN_CHANGED)) for channel, one in curves.items()}


def _seldom_in(curves: Mapping[Channel, bpy.types.FCurve]) -> dict[Channel, tuple]:
    """Return the number of modifiers of F-curves, what matters of the animator's, and `SELDOM_CHANGED` of their
    keys.
    """
    return {
        channel: (len(one.modifiers), *settings_of_others(one), _keys_of(one, SELDOM_CHANGED))
        for channel, one in curves.items()
    }


def _keys_of(fcurve: bpy.types.FCurve, names: tuple[str, ...]) -> bytes:
    points = fcurve.keyframe_points
    raw, views = _room(names, len(points))
    for name, view in views:
        points.foreach_get(name, view)
    return raw.tobytes()


@lru_cache(maxsize=256)
def _room(names: tuple[str, ...], count: int) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """Return memory to read these properties of so many keys into, and the part of each."""
    sizes = [count * KEY_FIELDS[name][0] * np.dtype(KEY_FIELDS[name][1]).itemsize for name in names]
    raw, ends = np.zeros(sum(sizes), np.uint8), np.cumsum(sizes)
    parts = zip(names, sizes, ends, strict=True)
    return raw, [(name, raw[end - size : end].view(KEY_FIELDS[name][1])) for name, size, end in parts]


def settings_of(obj: bpy.types.Object, slots: Sequence[Slot]) -> tuple:
    """Return what in-betweens of an object depend on beside its keys in these slots: its properties, drivers,
    strips, parent and constraints, and the axes that location runs along where these are other bones'.
    """
    values = [tuple(getattr(obj, name)) for name in OF_OBJECTS]
    driver_count = 0 if obj.animation_data is None else len(obj.animation_data.drivers)
    held = obj.parent is None, len(obj.constraints)
    return obj.rotation_mode, *values, driver_count, held, tuple(slots), _axes_in(obj) if slots and obj.pose else None


def _axes_in(rig: bpy.types.Object) -> bytes:
    """Return the bones at rest, as far as these say along which axes others move."""
    bones = armature(rig).bones
    is_local = np.empty(len(bones), bool)
    bones.foreach_get("use_local_location", is_local)
    at_rest = np.zeros((len(bones), 16), np.float32)
    if not is_local.all():
        bones.foreach_get("matrix_local", at_rest.ravel())
    return is_local.tobytes() + at_rest.tobytes()


def bones_in(rig: bpy.types.Object) -> np.ndarray:
    """Return how the bones of a rig turn, and what rotation and scale they have, a row each."""
    bones, columns = pose_bones(rig), []
    for name, width in {**WIDTHS, "rotation_mode": 1}.items():
        values = np.empty((len(bones), width), np.float32 if name in WIDTHS else np.int32)
        bones.foreach_get(name, values.ravel())
        columns.append(values.view(np.int32))
    return np.column_stack(columns[1:])
