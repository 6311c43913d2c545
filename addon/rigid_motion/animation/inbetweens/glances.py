"""A quick look at rigs: which of their many bones an edit was about.

Blender tells that an Action or an object was edited, and no more. To read all channels of a rig after every edit of one
of them takes longer than all the rest, so what they were is kept from the last look, as bytes, and compared. A change
that means nothing, of what is selected for example, counts too: whether in-betweens depend on it the digest tells.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ..actions.slots import Slot, uses_of
from ..transforms import WIDTHS, is_ours, split_path

_slots: dict[tuple[int, int], tuple[list[tuple[str, int]], list[object]]] = {}
"""Of each slot of a rig the channels, and what they were: by the Action's session id, and the slot's handle."""

_rigs: dict[int, tuple[object, dict[str, object]]] = {}
"""Of each rig what moves it, and what its bones were, by its session id."""


def forget_all() -> None:
    """Take all for changed at the next look."""
    _slots.clear()
    _rigs.clear()


def changed_in(slot: Slot) -> set[str] | None:
    """The prefixes of what has other channels in a slot than at the last look; None where that may be all."""
    if all(user.pose is None for user in slot.users):
        return None
    channelbag, key = slot.channelbag, (slot.action.session_uid, slot.handle)
    if channelbag is None:
        _slots.pop(key, None)
        return None
    fcurves = channelbag.fcurves
    flags = np.empty((3, len(fcurves)), np.int32)
    for row, name in zip(flags, ("mute", "extrapolation", "array_index"), strict=True):
        fcurves.foreach_get(name, row)
    channels = list(zip([fcurve.data_path for fcurve in fcurves], flags[2].tolist(), strict=True))
    memory = _Memory()
    keys = [_keys_of(fcurve, memory) for fcurve in fcurves]
    contents = list(zip(keys, *flags[:2].tolist(), strict=True))
    before = _slots.get(key)
    _slots[key] = channels, contents
    if before is None or before[0] != channels:
        return None
    pairs = zip(channels, before[1], contents, strict=True)
    return {split_path(channel[0])[0] for channel, old, new in pairs if old != new or new[0] is _MODIFIED}


_MODIFIED = object()


class _Memory:
    """A stretch of memory that NumPy can read. Property by property the same takes four times as long."""

    __array_interface__: dict[str, object]


_key_size = 0
"""How many bytes a key takes, as soon as two were seen one behind the other."""


def _keys_of(fcurve: bpy.types.FCurve, memory: _Memory) -> object:
    """The keys of an F-curve as they are in memory, where they lie one behind the other."""
    global _key_size
    keys = fcurve.keyframe_points
    count = len(keys)
    if count < 2:
        return _MODIFIED if count else None
    if fcurve.modifiers and split_path(fcurve.data_path)[1] in WIDTHS:
        return _MODIFIED
    first = keys[0].as_pointer()
    _key_size = _key_size or keys[1].as_pointer() - first
    shape = (count * _key_size,)
    memory.__array_interface__ = {"data": (first, True), "shape": shape, "typestr": "|V1", "version": 3}
    return np.asarray(memory).tobytes()


def changed_bones(rig: bpy.types.Object) -> list[bpy.types.PoseBone]:
    """The bones of a rig that are other than at the last look: how they are posed, or what moves them."""
    now = dict(zip(rig.pose.bones.keys(), _states(rig), strict=True))
    moved_by = [(key, sorted(map(str, strips))) for key, (_, _, strips) in uses_of(rig).items()]
    before = _rigs.get(rig.session_uid)
    _rigs[rig.session_uid] = moved_by, now
    if before is None or before[0] != moved_by or before[1].keys() != now.keys():
        return list(rig.pose.bones)
    return [rig.pose.bones[name] for name, state in now.items() if before[1][name] != state]


def _states(rig: bpy.types.Object) -> Iterator[object]:
    """All about each bone that in-betweens may depend on, but for its channels."""
    bones = rig.pose.bones
    count, columns = len(bones), []
    for name, width in WIDTHS.items():
        values = np.empty(count * width, np.float32)
        bones.foreach_get(name, values)
        columns.append(values.reshape(count, width))
    for row, bone in zip(np.concatenate(columns, axis=1), bones, strict=True):
        motion = bone.rigid_motion
        constraints = [(one.name, one.mute) for one in bone.constraints if is_ours(one)]
        yield row.tobytes(), bone.rotation_mode, motion.mode, motion.awaited, motion.mounted, constraints
