"""Oracle for bone poses in armature space, computed without the program, and the poses that Blender shows.

Blender computes the effect of rest poses, parents and bone settings on `oracle.expected_bases`. Matrices are
(m, 4, 4) in armature space, frames are the scene's.

Errors are fractions of a bone's reach: the largest distance of its head from the armature's origin, and at least its
own length. Blender takes bones with constraints through world space, in single precision, so the distance of the
armature from the world's origin, in the armature's units, is added.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np
from mathutils import Matrix

from tests.animation.keyed import key_frames
from tests.animation.oracle import expected_bases, play, shortest_quaternion, shown_worlds

TOLERANCE = 1e-5

Poses = dict[str, np.ndarray]
"""Matrices of bones by name."""


def shown_poses(rigs: Iterable[bpy.types.Object], frames: Sequence[float]) -> list[Poses]:
    """Return all bones of rigs by name, as the scene evaluates them. The scene returns to its frame."""
    rigs, scene = list(rigs), bpy.context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    shown = [{bone.name: np.empty((len(frames), 4, 4)) for bone in rig.pose.bones} for rig in rigs]
    for row, frame in enumerate(frames):
        play(rigs, frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for result, rig in zip(shown, rigs, strict=True):
            evaluated = rig.evaluated_get(depsgraph).pose.bones
            for name, matrices in result.items():
                matrices[row] = evaluated[name].matrix
    scene.frame_set(before, subframe=subframe)
    return shown


def shown_of(obj: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    """Return the displayed matrices of an object, or of the bones of a rig in armature space, shape (k, m, 4, 4)."""
    return np.stack([*shown_poses([obj], frames)[0].values()] if obj.pose else shown_worlds([obj], frames))


def placed(rig: bpy.types.Object) -> np.ndarray:
    """Return the matrices of a rig's bones displayed now, in armature space, shape (bones, 4, 4)."""
    bpy.context.view_layer.update()
    bones = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
    return np.array([bone.matrix for bone in bones])


def seen(rig: bpy.types.Object, name: str) -> np.ndarray:
    """Return the matrix of one bone displayed now, shape (4, 4)."""
    return placed(rig)[rig.pose.bones.find(name)]


def expected_poses(rig: bpy.types.Object, frames: Sequence[float], bones: Iterable[str] | None = None) -> Poses:
    """Return the poses of these bones (default: all) and their parents, from channels, modes, parents and settings."""
    frames, result = np.asarray(frames, dtype=np.float64), {}
    asked = [rig.pose.bones[name] for name in (rig.pose.bones.keys() if bones is None else bones)]
    needed = {item.name for bone in asked for item in (bone, *bone.parent_recursive)}
    for pose_bone in (bone for bone in rig.pose.bones if bone.name in needed):
        basis = expected_bases(pose_bone, frames)
        parent = None if pose_bone.parent is None else result[pose_bone.parent.name]
        result[pose_bone.name] = _placed(pose_bone.bone, basis, parent)
    return result


def _placed(bone: bpy.types.Bone, basis: np.ndarray, parent: np.ndarray | None) -> np.ndarray:
    """Return a bone's matrices from those of its channels and its parent, by Blender's rule."""
    above, at_rest, made = {}, bone.matrix_local, []
    for row, own in enumerate(basis):
        matrix = Matrix(own)
        if parent is not None:
            above = {"parent_matrix": Matrix(parent[row]), "parent_matrix_local": bone.parent.matrix_local}
            # Blender keeps a connected bone at its parent's tail.
            matrix.translation *= not bone.use_connect
        made.append(bone.convert_local_to_pose(matrix, at_rest, **above))
    return np.array(made)


def assert_posed(rig: bpy.types.Object, frames: Sequence[float], bones: Iterable[str] | None = None) -> None:
    """Check that the scene shows these bones of a rig (by default all) where they must be."""
    (shown,) = shown_poses([rig], frames)
    assert_same_poses(rig, frames, shown, expected_poses(rig, frames, bones=bones), bones)


def assert_same_poses(
    rig: bpy.types.Object, frames: Sequence[float], shown: Poses, expected: Poses, bones: Iterable[str] | None = None
) -> None:
    """Check that poses are equal, to `TOLERANCE` of each bone's reach.

    Where Blender's own quaternion passes near zero, single precision leaves less of its direction, and no difference
    can repair that: the tolerance grows by the same factor.
    """
    away = _distance_from_world(rig, frames)
    for name in expected if bones is None else bones:
        pose_bone, right, off = rig.pose.bones[name], expected[name], shown[name] - expected[name]
        reach = max(pose_bone.bone.length, np.linalg.norm(right[:, :3, 3], axis=1).max(initial=0.0)) + away
        size = max(1.0, np.abs(right[:, :3, :3]).max(initial=0.0))
        turned = np.abs(off[:, :3, :3]).max(axis=(1, 2), initial=0.0) / size
        error = np.maximum(np.linalg.norm(off[:, :3, 3], axis=1) / reach, turned)
        error *= shortest_quaternion(pose_bone, frames)
        worst = int(np.argmax(error))
        assert error[worst] < TOLERANCE, (
            f"{rig.name}, {name} ({pose_bone.rotation_mode}) is off by {error[worst]:.3g} of its reach on frame "
            f"{frames[worst]} (keys on {key_frames(pose_bone)[:20]})"
        )


def _distance_from_world(rig: bpy.types.Object, frames: Sequence[float]) -> float:
    """Return the largest distance of the armature from the world's origin, in the units of its smallest axis."""
    worlds = shown_worlds([rig], [frames[0], frames[len(frames) // 2], frames[-1]])[0]
    return float(max(np.linalg.norm(world[:3, 3]) / np.linalg.norm(world[:3, :3], axis=0).min() for world in worlds))
