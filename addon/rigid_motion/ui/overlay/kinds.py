"""What the paths of each kind of transform are drawn by, and which point of a bone is followed.

The path of a bone is that of its head, in the space of its channels, placed by its parent as it is posed on the current
frame. The head of a bone that only turns stays where it is: there it is the path of the tail.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...animation.compute.components import LOCATION
from ...animation.compute.sources import Source
from ...animation.transforms import BoneTransform, ExactObjectTransform, ObjectTransform, Transform
from .parents import unless_same
from .points import Followed, axis_length_of, space_of


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
    rig = bone.id_data.evaluated_get(depsgraph)
    evaluated = rig.pose.bones[bone.name]
    rest, parent = evaluated.bone, evaluated.parent
    above = {} if parent is None else {"parent_matrix": parent.matrix, "parent_matrix_local": parent.bone.matrix_local}

    def posed(basis: Matrix) -> Matrix:
        return rest.convert_local_to_pose(basis, rest.matrix_local, **above)

    stands = posed(Matrix())
    space = Matrix.Translation(stands.translation)
    for column in range(3):
        unit = Vector(float(row == column) for row in range(3))
        along = posed(Matrix.Translation(unit)).translation - stands.translation
        for row in range(3):
            space[row][column] = along[row]
    turned = space.to_3x3().inverted_safe() @ stands.to_3x3()
    return rig.matrix_world @ space, unless_same(np.array(turned))


def followed(bone: bpy.types.PoseBone, source: Source, turned: np.ndarray | None) -> Followed:
    """Return the point of a bone that its path is of."""
    moves = LOCATION in source.keyed and not bone.bone.use_connect
    stays = np.zeros(3) if moves or bone.bone.use_connect else np.array(bone.location)
    tip = np.zeros(3) if moves else np.array((0.0, bone.bone.length, 0.0))
    scale = np.ones(3) if moves or source.uniform_scale else np.array(bone.scale)
    return Followed(moves, stays, tip * scale, turned)


def axis_length_of_bone(bone: bpy.types.PoseBone, source: Source) -> float:
    """Return how long to draw its local axes: half as long as it is. At scale 1, where the source has a scale."""
    size = 0.5 * bone.bone.length
    return float(size if source.uniform_scale else size * np.abs(np.array(bone.scale)).max()) or 1.0


Carrier = bpy.types.Object | bpy.types.PoseBone


class PathKind(NamedTuple):
    """How the paths of one kind of transform are drawn."""

    space: Callable[[Carrier, bpy.types.Depsgraph], tuple[Matrix, np.ndarray | None]]
    """Returns where a path leads in the world, and what stands between rotation and location in it,
    None where nothing does."""

    point: Callable[[Carrier, Source, np.ndarray | None], Followed | None]
    """The point that a path is of, None for the origin."""

    axis_length: Callable[[Carrier, Source], float]
    """Returns how long its local axes are."""


OBJECT = PathKind(lambda obj, depsgraph: (space_of(obj, depsgraph), None), lambda *_: None, axis_length_of)

PATH_KINDS: dict[type[Transform], PathKind] = {
    BoneTransform: PathKind(space_of_bone, followed, axis_length_of_bone),
    ObjectTransform: OBJECT,
    ExactObjectTransform: OBJECT,
}
"""A row for each of the `transforms.KINDS`."""
