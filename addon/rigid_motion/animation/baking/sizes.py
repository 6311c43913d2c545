"""How large things are: in the scene's units, and in those of their channels."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ..transforms import Transform

SOME_SIZE = 0.1
"""The radius, in metres, of what has no size."""

OF_A_RIG = 0.003
"""The tolerance that the keys of a rig are reduced to at first, of its size: 5 mm for a grown-up."""


def radius_of(obj: bpy.types.Object | bpy.types.PoseBone) -> float:
    """How far an object or a pose bone reaches from its origin as it is now, in the scene's units.

    That is the farthest corner of its bounding box, and the length of a bone. Empties and cameras are as large as they
    are drawn; what has no size at all counts as ten centimetres.
    """
    if isinstance(obj, bpy.types.PoseBone):
        return obj.length * size_of(_evaluated(obj.id_data).matrix_world) or SOME_SIZE / metres_per_unit(
            bpy.context.scene
        )
    evaluated = _evaluated(obj)
    corners = np.array(evaluated.bound_box)
    size = 0.0
    if np.ptp(corners) > 0.0:
        size = float(np.linalg.norm(corners @ np.array(evaluated.matrix_world.to_3x3()).T, axis=1).max())
    elif obj.type == "EMPTY":
        size = obj.empty_display_size * size_of(evaluated.matrix_world)
    elif obj.type == "CAMERA":
        size = obj.data.display_size * size_of(evaluated.matrix_world)
    return size or SOME_SIZE / metres_per_unit(bpy.context.scene)


def first_tolerance(scene: bpy.types.Scene, targets: Iterable[Transform]) -> float:
    """What to begin with: a millimetre, and of a rig a share of its size; in the scene's units."""
    sizes = [max(target.animated.dimensions) for target in targets if target.is_part]
    if not sizes or max(sizes) <= 0.0:
        return 0.001 / metres_per_unit(scene)
    return float(f"{OF_A_RIG * max(sizes):.2g}")


def metres_per_unit(scene: bpy.types.Scene) -> float:
    return 1.0 if scene.unit_settings.system == "NONE" else scene.unit_settings.scale_length


def _evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def size_of(matrix: object) -> float:
    """The scale of a matrix, the same along all axes."""
    return float(np.cbrt(abs(np.linalg.det(np.array(matrix)[:3, :3]))))


def in_channels(transform: Transform, radius: float, scaled: bool) -> tuple[float, float]:
    """The length of a unit of the channels in the scene, and a radius in it, before the pose itself scales it."""
    own, world = size_of(transform.carrier.matrix_basis), size_of(_evaluated(transform.animated).matrix_world)
    if transform.is_part:
        world *= size_of(transform.carrier.matrix)
    if not (own > 0.0 and world > 0.0):
        return 1.0, radius
    return world / own, radius / (world if scaled else world / own)
