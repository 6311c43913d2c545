"""Placing objects and bones: their poses in the world and in channel spaces, and the components that produce them.

Spaces are Blender's matrices as currently evaluated; arrays of poses have shape (..., 4, 4), in double precision.
"""

from __future__ import annotations

from typing import Any, cast

import bpy
import numpy as np
from mathutils import Matrix

from ...motion import Poses
from ...motion.quaternions import from_matrices, matrices
from ..evaluation.bodies import turn_into_quaternions
from ..evaluation.channel_values import rotation_values
from ..evaluation.components import LOCATION, ROTATION, ROWS, SCALE
from ..transforms import Transform
from .dependencies import node_of


def world_of(obj: bpy.types.Object, bone: str, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """Return the world matrix of an object or of one of its bones, "" for none."""
    evaluated = obj.evaluated_get(depsgraph)
    matrix = evaluated.matrix_world
    return matrix @ cast(bpy.types.Pose, evaluated.pose).bones[bone].matrix if bone else matrix.copy()


def hang_of(user: Transform) -> Matrix:
    """Return the space of a transform's channels relative to the space given by `own_space`."""
    obj = user.animated
    if not hangs_on_bone(user):
        return Matrix()
    bone = cast(Any, obj.parent).data.bones[obj.parent_bone]
    end = bone.matrix_local.inverted() if bone.use_relative_parent else Matrix.Translation((0.0, bone.length, 0.0))
    return end @ obj.matrix_parent_inverse


def channel_space(user: Transform, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """Return the world matrix of the space of a transform's channels when no holder holds it.

    Some bones inherit location differently from rotation; for them it is the space of a bone at rest.
    """
    obj = user.animated
    if user.is_part:
        bone = cast(bpy.types.PoseBone, user.carrier)
        return obj.convert_space(pose_bone=bone, matrix=Matrix(), from_space="LOCAL", to_space="WORLD")
    if obj.parent is None:
        return Matrix()
    if hangs_on_bone(user):
        return world_of(obj.parent, obj.parent_bone, depsgraph) @ hang_of(user)
    return world_of(obj.parent, "", depsgraph) @ obj.matrix_parent_inverse


def world_matrix(transform: Transform) -> Matrix:
    """Return the world matrix of a transform on the current frame."""
    return world_of(*node_of(transform), bpy.context.evaluated_depsgraph_get())


def converted(
    transform: Transform, matrix: Matrix, first: str, second: str, depsgraph: bpy.types.Depsgraph | None = None
) -> Matrix:
    """Convert a matrix between the world and the space of a transform's channels when no holder holds it."""
    obj = transform.animated
    if transform.is_part:
        spaces: dict[str, Any] = {"pose_bone": transform.carrier, "from_space": first, "to_space": second}
        return obj.convert_space(matrix=matrix, **spaces)
    # Blender's local space of an object is a different one if it has no parent, or hangs on a bone.
    space = channel_space(transform, depsgraph or bpy.context.evaluated_depsgraph_get())
    return space @ matrix if second == "WORLD" else space.inverted_safe() @ matrix


def hangs_on_bone(user: Transform) -> bool:
    obj = user.animated
    return not user.is_part and obj.parent is not None and obj.parent_type == "BONE" and bool(obj.parent_bone)


def unevenness_of(matrix: Matrix) -> float:
    """Return how far the axes of a matrix are from being orthogonal and of equal length, 0 if they are."""
    axes = np.array(matrix.to_3x3())
    squares = axes.T @ axes
    return float(np.abs(squares / (np.trace(squares) / 3.0) - np.eye(3)).max())


def poses_of(matrices: np.ndarray) -> tuple[Poses, np.ndarray]:
    """Return the rigid part of matrices (..., 4, 4) without shear, shape (...), and their scales, shape (..., 3)."""
    axes = matrices[..., :3, :3]
    # Blender represents a mirroring along one axis as one along all axes, plus a rotation.
    sizes = np.linalg.norm(axes, axis=-2) * np.where(np.linalg.det(axes) < 0.0, -1.0, 1.0)[..., None]
    turns = from_matrices(axes / np.where(sizes == 0.0, 1.0, sizes)[..., None, :])
    return Poses(matrices[..., :3, 3], turns), sizes


def rows_of(poses: Poses, sizes: np.ndarray, transform: Transform, first: np.ndarray) -> np.ndarray:
    """Return the components (10, m) of poses (m,) with scales (m, 3), the first rotation near that of `first` (10,).

    Rotations do not jump from one pose to the next.
    """
    turns = poses.quaternions
    if turns[0] @ first[ROWS[ROTATION]] < 0.0 and transform.order is None:
        turns = -turns
    rows = np.empty((10, len(turns)))
    rows[ROWS[LOCATION]], rows[ROWS[SCALE]] = poses.positions.T, sizes.T
    rows[ROWS[ROTATION]] = rotation_values(turns, first[ROWS[ROTATION]], transform.order)
    return rows


def matrices_of(rows: np.ndarray, order: str | None) -> np.ndarray:
    """Return the matrices (m, 4, 4) of components (10, m) with rotations of this order."""
    rows, result = rows.copy(), np.tile(np.eye(4), (rows.shape[1], 1, 1))
    turn_into_quaternions(rows, order)
    result[:, :3, :3] = np.moveaxis(matrices(rows[ROWS[ROTATION]].T), -1, 0) * rows[ROWS[SCALE]].T[:, None]
    result[:, :3, 3] = rows[ROWS[LOCATION]].T
    return result
