"""How large things are: in the scene's units, and in those of their channels."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ...gltf.sizes import OF_A_BODY, OF_KEY_POSES
from ..transforms import Transform
from ..transforms.reaches import SOME_SIZE, metres_per_unit, reach_of, size_of

SAME_PLACE = 0.1
"""Heads of bones that are closer than this, of a bone's length, make no size."""


def radius_of(obj: bpy.types.Object | bpy.types.PoseBone) -> float:
    """Return how far an object or a pose bone reaches from its origin, in the scene's units.

    That is the farthest corner of an object's bounding box as it is now, how far a bone reaches at rest (`reach_of`),
    and of a rig how far its bones reach as it is posed now. Empties and cameras are as large as they are drawn; what
    has no size at all counts as ten centimetres.
    """
    if isinstance(obj, bpy.types.PoseBone):
        return reach_of(obj) * (size_of(_evaluated(obj.id_data).matrix_world) or 1.0)
    evaluated = _evaluated(obj)
    if obj.pose is not None and len(obj.pose.bones):
        axes = np.array(evaluated.matrix_world.to_3x3())
        heads = np.array([bone.head for bone in evaluated.pose.bones]) @ axes.T
        reaches = np.array([reach_of(bone) for bone in obj.pose.bones]) * size_of(axes)
        return float((np.linalg.norm(heads, axis=1) + reaches).max()) or SOME_SIZE / metres_per_unit(bpy.context.scene)
    corners = np.array(evaluated.bound_box)
    size = 0.0
    if np.ptp(corners) > 0.0:
        size = float(np.linalg.norm(corners @ np.array(evaluated.matrix_world.to_3x3()).T, axis=1).max())
    elif obj.type == "EMPTY":
        size = obj.empty_display_size * size_of(evaluated.matrix_world)
    elif obj.type == "CAMERA":
        size = obj.data.display_size * size_of(evaluated.matrix_world)
    return size or SOME_SIZE / metres_per_unit(bpy.context.scene)


def rig_size(rig: bpy.types.Object) -> float:
    """Return the size of a rig in the scene's units: the largest extent of its joints along any axis, at rest.

    Joints are the heads of bones, for importers make up where the last bones end. A rig whose heads are in one place is
    as large as the bone that reaches farthest.
    """
    world = _evaluated(rig).matrix_world
    heads = np.array([world @ bone.bone.head_local for bone in rig.pose.bones]).reshape(-1, 3)
    extent = float(np.ptp(heads, axis=0).max()) if len(heads) else 0.0
    reach = max((reach_of(bone) for bone in rig.pose.bones), default=0.0) * size_of(world)
    return extent if extent > SAME_PLACE * reach else reach


def first_tolerance(scene: bpy.types.Scene, targets: Iterable[Transform], *, shared: bool = False) -> float:
    """Return the tolerance to begin with, in the scene's units: a millimetre, and of a rig a share of its size.

    That is larger where its bones share key poses.
    """
    sizes = [rig_size(rig) for rig in {target.animated for target in targets if target.is_part}]
    if not sizes or max(sizes) <= 0.0:
        return 0.001 / metres_per_unit(scene)
    return float(f"{(OF_KEY_POSES if shared else OF_A_BODY) * max(sizes):.2g}")


def _evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def scale_in_scene(transform: Transform) -> float:
    """Return the size of something in the scene as it is now, 1 where it has none."""
    return size_of(_evaluated(transform.animated).matrix_world) or 1.0


def into_scene(transform: Transform) -> np.ndarray:
    """Return what takes the axes of an object's channels to those of the scene, shape (3, 3): its parents,
    as they are now.
    """
    obj = transform.carrier
    if obj.parent is None and not obj.constraints:
        return np.eye(3)
    basis, world = np.array(obj.matrix_basis.to_3x3()), np.array(_evaluated(obj).matrix_world.to_3x3())
    if not (size_of(basis) > 0.0 and size_of(world) > 0.0):
        return np.eye(3)
    # Constraints may turn it anyhow: then only its size counts.
    return np.eye(3) * size_of(world) / size_of(basis) if obj.constraints else world @ np.linalg.inv(basis)
