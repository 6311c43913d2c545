"""Which objects and bones have to do with modes: all others are never read."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..actions.slots import actions_of
from ..transforms import Transform, is_part, transform_of


def transforms_under(objects: Iterable[bpy.types.Object]) -> list[Transform]:
    """Return these objects, and of rigs all bones that their Actions move,
    or that have modes or constraints for them.
    """
    result: dict[Transform, None] = {}
    for obj in objects:
        result[transform_of(obj)] = None
        if obj.pose is not None and has_bones(obj):
            result |= dict.fromkeys(map(transform_of, obj.pose.bones))
    return list(result)


def uses_modes(obj: bpy.types.Object) -> bool:
    """Return whether an object or its bones have, or had, anything to do with modes."""
    if obj.rigid_motion.has_bones or _has_properties(obj):
        return True
    return any(len(action.rigid_motion.slots) > 0 for action in actions_of(obj))


def has_mode(obj: bpy.types.Object) -> bool:
    """Return whether an object itself has, or had, anything to do with modes."""
    records = (record for action in actions_of(obj) for record in action.rigid_motion.slots)
    return _has_properties(obj) or any(not is_part(record.prefix) for record in records)


def has_bones(obj: bpy.types.Object) -> bool:
    """Return whether bones of a rig have anything to do with modes."""
    return obj.rigid_motion.has_bones or any(
        is_part(record.prefix) for action in actions_of(obj) for record in action.rigid_motion.slots
    )


def _has_properties(obj: bpy.types.Object) -> bool:
    motion = obj.rigid_motion
    return (
        any(motion.filled) or bool(motion.filled_components) or motion.mode != "BLENDER" or motion.awaited != "BLENDER"
    )
