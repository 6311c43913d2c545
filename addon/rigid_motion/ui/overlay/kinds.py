"""What the paths of each kind of transform are drawn by, and which point of it is followed.

The path of a bone is that of its head, in the space of its channels, placed by its parent as it is posed on the current
frame. The head of a bone that only turns stays where it is: there it is the path of the tail.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.evaluation.components import LOCATION
from ...animation.evaluation.sources import KeyedTransform
from ...animation.transforms import Transform, transform_of
from ...blender import pose_bones
from .parents import unless_same
from .points import Followed, axis_length_of_object, space_of_object


def space_of_bone(bone: bpy.types.PoseBone, depsgraph: bpy.types.Depsgraph) -> tuple[Matrix, np.ndarray | None]:
    """Return the map from the space of a bone's location channels into the world,
    as its parent is posed on the current frame.

    Returns
    -------
    space : Matrix
    turned : array, shape (3, 3), or None
        What stands between its rotation and that space where these are not the same: where a bone does not inherit the
        rotation or scale of its parent, or is not moved along its own axes. None where they are.
    """
    rig = transform_of(bone).animated.evaluated_get(depsgraph)
    evaluated = pose_bones(rig)[bone.name]
    rest, parent = evaluated.bone, evaluated.parent
    above: Any = (
        {} if parent is None else {"parent_matrix": parent.matrix, "parent_matrix_local": parent.bone.matrix_local}
    )

    def posed(basis: Matrix) -> Matrix:
        return rest.convert_local_to_pose(basis, rest.matrix_local, **above)

    stands = posed(Matrix())
    space = Matrix.Translation(stands.translation[:])
    for column in range(3):
        unit = [float(row == column) for row in range(3)]
        along = posed(Matrix.Translation(unit)).translation - stands.translation
        for row in range(3):
            space[row][column] = along[row]
    turned = space.to_3x3().inverted_safe() @ stands.to_3x3()
    return rig.matrix_world @ space, unless_same(np.array(turned))


def followed(transform: Transform, source: KeyedTransform, turned: np.ndarray | None) -> Followed | None:
    """Return the point that a path is of: that which leads, or else one of a bone; None for the origin of an object."""
    lead, obj = np.array(transform.motion.lead), transform.animated
    if not transform.is_part:
        scale = np.ones(3) if source.uniform_scale else np.array(obj.scale) * np.array(obj.delta_scale)
        return Followed(True, np.zeros(3), lead * scale, None) if lead.any() else None
    bone = transform.pose_bone
    moves = LOCATION in source.keyed and not bone.bone.use_connect
    stays = np.zeros(3) if moves or bone.bone.use_connect else np.array(bone.location)
    tip = lead if moves or lead.any() else np.array((0.0, bone.bone.length, 0.0))
    scale = np.ones(3) if source.uniform_scale else np.array(bone.scale)
    return Followed(moves, stays, tip * scale, turned)


def axis_length_of_bone(bone: bpy.types.PoseBone, source: KeyedTransform) -> float:
    """Return how long to draw its local axes: half as long as it is. At scale 1, where the source has a scale."""
    size = 0.5 * bone.bone.length
    return float(size if source.uniform_scale else size * np.abs(np.array(bone.scale)).max()) or 1.0


def space_of(transform: Transform, depsgraph: bpy.types.Depsgraph) -> tuple[Matrix, np.ndarray | None]:
    """Return where a path leads in the world, and what stands between rotation and location in it, None where nothing
    does.
    """
    if transform.is_part and (base := transform.motion.base) is not None:
        return base.evaluated_get(depsgraph).matrix_world.copy(), None
    if transform.is_part:
        return space_of_bone(transform.pose_bone, depsgraph)
    return space_of_object(transform.animated, depsgraph), None


def axis_length_of(transform: Transform, source: KeyedTransform) -> float:
    """Return how long its local axes are."""
    if transform.is_part:
        return axis_length_of_bone(transform.pose_bone, source)
    return axis_length_of_object(transform.animated, source)
