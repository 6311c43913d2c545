"""Space of a transform's location channels, for objects and bones, and the length of its drawn axes.

The path of a bone is that of its head, in the space of its channels, placed by its parent as it is posed on the current
frame. The head of a bone that only turns stays in place: there it is the path of the tail.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.transforms import Transform, transform_of
from ...animation.transforms.sizes import drawn_size
from ...blender import pose_bones
from .parents import unless_same


class Space(NamedTuple):
    """The space of an object's or a bone's channels on the current frame."""

    matrix: Matrix
    """The map from the space of its location channels into the world."""

    turn: np.ndarray | None = None
    """The rotation (3, 3) from the axes of that space to those of its rotation; None if they are the same.

    They differ if a bone does not inherit the rotation or scale of its parent, or moves along other axes than its own.
    """


def space_of(transform: Transform, depsgraph: bpy.types.Depsgraph) -> Space:
    """Return the space of a transform's channels, with its parents as they are on the current frame."""
    if not transform.is_part:
        return Space(_space_of_object(transform.animated, depsgraph))
    if (base := transform.motion.base) is not None:
        return Space(base.evaluated_get(depsgraph).matrix_world.copy())
    return _space_of_bone(transform.pose_bone, depsgraph)


def _space_of_bone(bone: bpy.types.PoseBone, depsgraph: bpy.types.Depsgraph) -> Space:
    rig = transform_of(bone).animated.evaluated_get(depsgraph)
    evaluated = pose_bones(rig)[bone.name]
    rest, parent = evaluated.bone, evaluated.parent
    above: Any = (
        {} if parent is None else {"parent_matrix": parent.matrix, "parent_matrix_local": parent.bone.matrix_local}
    )

    def posed(basis: Matrix) -> Matrix:
        return rest.convert_local_to_pose(basis, rest.matrix_local, **above)

    unmoved = posed(Matrix())
    space = Matrix.Translation(unmoved.translation[:])
    for column in range(3):
        unit = [float(row == column) for row in range(3)]
        along = posed(Matrix.Translation(unit)).translation - unmoved.translation
        for row in range(3):
            space[row][column] = along[row]
    turned = space.to_3x3().inverted_safe() @ unmoved.to_3x3()
    return Space(rig.matrix_world @ space, unless_same(np.array(turned)))


def _space_of_object(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """Return the matrix from an object's channels into the world, with its parent as it is on the current frame.

    With an object as parent: the parent's evaluated matrix times the inverse at parenting. With a bone, vertices or a
    lattice: the map from the object's evaluated location, rotation and scale to where it is seen, constraints included.
    """
    if obj.parent is None:
        return Matrix.Identity(4)
    if obj.parent_type == "OBJECT":
        return obj.parent.evaluated_get(depsgraph).matrix_world @ obj.matrix_parent_inverse
    evaluated = obj.evaluated_get(depsgraph)
    return evaluated.matrix_world @ evaluated.matrix_basis.inverted_safe()


def axis_length_of(transform: Transform) -> float:
    """Return the length of its drawn local axes at scale 1: half its size."""
    if transform.is_part:
        return 0.5 * transform.pose_bone.bone.length or 1.0
    obj = transform.animated
    return drawn_size(obj) or 0.5 * float(np.ptp(np.array(obj.bound_box), axis=0).max()) or 1.0
