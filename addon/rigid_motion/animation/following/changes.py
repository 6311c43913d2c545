"""Changes: the data-blocks that Blender reports as edited, and the channels of an Action that an edit affects.

Blender's dependency graphs name data-blocks that wait to be evaluated, or just were. They are looked up by name alone,
because the original and the library of a block just deleted can no longer be queried. For an Action, the graphs report
nothing more specific, so a snapshot of its keys is kept and compared.
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
"""The properties of keys that change while dragging; they are compared first."""

SELDOM_CHANGED = (
    *("interpolation", "easing", "back", "amplitude", "period", "type"),
    *("handle_left_type", "handle_right_type"),
)
"""The other properties of keys that in-betweens depend on."""


def edited_actions(*graphs: bpy.types.Depsgraph) -> set[bpy.types.Action]:
    """Return the Actions that wait to be evaluated in dependency graphs, or just were."""
    updates = [update.id for graph in graphs if graph.id_type_updated("ACTION") for update in graph.updates]
    return _originals(bpy.data.actions, [block for block in updates if isinstance(block, bpy.types.Action)])


def edited_objects(*graphs: bpy.types.Depsgraph) -> set[bpy.types.Object]:
    """Return the objects that wait to be evaluated in dependency graphs, or just were, and rigs of such armatures."""
    edited = (graph for graph in graphs if graph.id_type_updated("OBJECT") or graph.id_type_updated("ARMATURE"))
    updates = [update.id for graph in edited for update in graph.updates]
    result = _originals(bpy.data.objects, [block for block in updates if isinstance(block, bpy.types.Object)])
    # A setting of a bone at rest updates only the armature until that is evaluated.
    alone = {block.name for block in updates if isinstance(block, bpy.types.Armature)}
    alone -= {armature(obj).name for obj in result if obj.type == "ARMATURE"}
    if alone:
        result |= {obj for obj in bpy.data.objects if obj.type == "ARMATURE" and armature(obj).name in alone}
    return result


def _originals(present: Any, blocks: Iterable[bpy.types.ID]) -> set:
    """Return the originals of these evaluated copies in the file; linked blocks with the same names are included."""
    names = {block.name for block in blocks}
    keys = [*names, *((name, library.filepath) for library in bpy.data.libraries for name in names)]
    return set(map(present.get, keys)) - {None}


def add_action(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, added: set[tuple[int, int]]) -> None:
    """Add the Action of an object to the dependency graph, which otherwise does not report its edits.

    Blender omits an Action made by *Make Single User > Object Animation*. `added` has the session ids of the objects
    and Actions for which this was tried.
    """
    action = None if obj.animation_data is None else obj.animation_data.action
    if action is None or (key := (obj.session_uid, action.session_uid)) in added:
        return
    if not action.evaluated_get(depsgraph).is_evaluated:
        added.add(key)
        # This is no edit, but makes Blender rebuild its dependencies.
        obj.instance_type = obj.instance_type


def graphs_of(scene: bpy.types.Scene) -> list[bpy.types.Depsgraph]:
    return [layer.depsgraph for layer in scene.view_layers if layer.depsgraph is not None]


class Snapshot:
    """The keys of a slot when it was last compared."""

    def __init__(self, slot: Slot) -> None:
        curves = _curves_in(slot)
        self._often, self._seldom = _often_in(curves), _seldom_in(curves)

    def look(self, slot: Slot) -> set[Channel]:
        """Compare a slot with the snapshot and update that; return the F-curves that changed, were added or removed."""
        curves = _curves_in(slot)
        often = _often_in(curves)
        changed, self._often = _differing(self._often, often), often
        # An edit of one transform changes only that. If several or none changed so far, marks may differ, too.
        if len({split_path(path)[0] for path, _ in changed}) != 1:
            seldom = _seldom_in(curves)
            changed |= _differing(self._seldom, seldom)
            self._seldom = seldom
        return changed

    def note(self, curves: Mapping[Channel, bpy.types.FCurve]) -> None:
        """Add the present state of these F-curves to the snapshot, so that it does not count as a change later."""
        curves = {channel: fcurve for channel, fcurve in curves.items() if _affects_in_betweens(channel[0])}
        self._often |= _often_in(curves)
        self._seldom |= _seldom_in(curves)


def _differing(before: Mapping[Channel, object], now: Mapping[Channel, object]) -> set[Channel]:
    return {channel for channel, one in now.items() if before.get(channel) != one} | (before.keys() - now.keys())


def _curves_in(slot: Slot) -> dict[Channel, bpy.types.FCurve]:
    """Return the F-curves of a slot that in-betweens depend on."""
    curves = ((fcurve.data_path, fcurve) for fcurve in slot.fcurves)
    return {(path, fcurve.array_index): fcurve for path, fcurve in curves if _affects_in_betweens(path)}


@lru_cache(maxsize=65536)
def _affects_in_betweens(path: str) -> bool:
    prop = split_path(path)[1]
    return prop in WIDTHS or prop == TURNS_PROPERTY or prop.startswith("constraints[")


def _often_in(curves: Mapping[Channel, bpy.types.FCurve]) -> dict[Channel, tuple[bool, str, bytes]]:
    """Return the muting and extrapolation of F-curves, and the properties `OFTEN_CHANGED` of their keys."""
    return {channel: (one.mute, one.extrapolation, _keys_of(one, OFTEN_CHANGED)) for channel, one in curves.items()}


def _seldom_in(curves: Mapping[Channel, bpy.types.FCurve]) -> dict[Channel, tuple]:
    """Return the number of modifiers, the relevant data of the animator's, and `SELDOM_CHANGED` of the keys."""
    return {
        channel: (len(one.modifiers), *settings_of_others(one), _keys_of(one, SELDOM_CHANGED))
        for channel, one in curves.items()
    }


def _keys_of(fcurve: bpy.types.FCurve, names: tuple[str, ...]) -> bytes:
    points = fcurve.keyframe_points
    raw, views = _read_buffers(names, len(points))
    for name, view in views:
        points.foreach_get(name, view)
    return raw.tobytes()


@lru_cache(maxsize=256)
def _read_buffers(names: tuple[str, ...], count: int) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """Return a buffer to read these properties of this many keys into, and a view of it for each property."""
    sizes = [count * KEY_FIELDS[name][0] * np.dtype(KEY_FIELDS[name][1]).itemsize for name in names]
    raw, ends = np.zeros(sum(sizes), np.uint8), np.cumsum(sizes)
    parts = zip(names, sizes, ends, strict=True)
    return raw, [(name, raw[end - size : end].view(KEY_FIELDS[name][1])) for name, size, end in parts]


def settings_of(obj: bpy.types.Object, slots: Sequence[Slot]) -> tuple:
    """Return what in-betweens of an object depend on besides its keys in these slots: its properties, drivers, strips,
    parent and constraints, and the axes that the location of its bones runs along.
    """
    values = [tuple(getattr(obj, name)) for name in OF_OBJECTS]
    driver_count = 0 if obj.animation_data is None else len(obj.animation_data.drivers)
    held = obj.parent is None, len(obj.constraints)
    return obj.rotation_mode, *values, driver_count, held, tuple(slots), _axes_in(obj) if slots and obj.pose else None


def _axes_in(rig: bpy.types.Object) -> bytes:
    """Return the bones at rest, as far as they determine the axes that locations run along."""
    bones = armature(rig).bones
    is_local = np.empty(len(bones), bool)
    bones.foreach_get("use_local_location", is_local)
    at_rest = np.zeros((len(bones), 16), np.float32)
    if not is_local.all():
        bones.foreach_get("matrix_local", at_rest.ravel())
    return is_local.tobytes() + at_rest.tobytes()


def bones_in(rig: bpy.types.Object) -> np.ndarray:
    """Return the rotation mode, rotation and scale of each bone of a rig, one row per bone."""
    bones, columns = pose_bones(rig), []
    for name, width in {**WIDTHS, "rotation_mode": 1}.items():
        values = np.empty((len(bones), width), np.float32 if name in WIDTHS else np.int32)
        bones.foreach_get(name, values.ravel())
        columns.append(values.view(np.int32))
    return np.column_stack(columns[1:])
