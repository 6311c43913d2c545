"""How far things reach from their origins, whatever hangs on them included, and how large a unit of theirs is."""

from __future__ import annotations

import bpy
import numpy as np

from .transform import Transform

SOME_SIZE = 0.1
"""The radius, in metres, of what has no size."""


def reach_of(bone: bpy.types.PoseBone) -> float:
    """Return how far a bone reaches from its head at rest, in the rig's unit: its length.

    Importers make up the lengths of bones that nothing hangs on: such a bone reaches no further than the one before it,
    as far as that is long, or its head is from the head of that.
    """
    length, parent = bone.bone.length, bone.bone.parent
    if parent is not None and not bone.bone.children:
        before = (bone.bone.head_local - parent.head_local).length
        length = min(length, max(before, parent.length))
    return length or SOME_SIZE / metres_per_unit(bpy.context.scene)


def metres_per_unit(scene: bpy.types.Scene) -> float:
    return 1.0 if scene.unit_settings.system == "NONE" else scene.unit_settings.scale_length


def size_of(matrix: object) -> float:
    """Return the scale of a matrix, the same along all axes."""
    return float(np.cbrt(abs(np.linalg.det(np.array(matrix)[:3, :3]))))


def reach_at_rest(transform: Transform, known: dict[bpy.types.Bone, float]) -> float:
    """Return how far a transform reaches from its origin, in the units of its channels: with all bones that hang on it,
    as far as these stretch in one line; an object's box without its modifiers.

    `known` keeps what was found of bones.
    """
    if transform.is_part:
        return _reach_of_chain(transform.carrier.bone, known)
    obj = transform.carrier
    size = float(np.linalg.norm(np.array(obj.bound_box), axis=1).max()) * max(map(abs, obj.scale))
    if not size and obj.type == "EMPTY":
        size = obj.empty_display_size * max(map(abs, obj.scale))
    return size or SOME_SIZE / metres_per_unit(bpy.context.scene)


def metres_per_channel_unit(transform: Transform) -> float:
    """Return how many metres a unit of its channels is as it stands, 1 where its parents have no size."""
    obj = transform.carrier.id_data
    space = obj if transform.is_part else obj.parent
    return metres_per_unit(bpy.context.scene) * (1.0 if space is None else size_of(space.matrix_world) or 1.0)


def _reach_of_chain(bone: bpy.types.Bone | None, known: dict[bpy.types.Bone, float]) -> float:
    if bone is None:  # It was just made in Edit Mode.
        return SOME_SIZE / metres_per_unit(bpy.context.scene)
    chain = [bone]
    for item in chain:
        if item not in known:
            chain += item.children
    for item in reversed(chain):
        if item not in known:
            children = [(other.head_local - item.head_local).length + known[other] for other in item.children]
            known[item] = max(children, default=0.0) or _length(item)
    return known[bone]


def _length(bone: bpy.types.Bone) -> float:
    """Return how far a bone reaches that nothing hangs on: see `reach_of`."""
    length, parent = bone.length, bone.parent
    if parent is not None:
        length = min(length, max((bone.head_local - parent.head_local).length, parent.length))
    return length
