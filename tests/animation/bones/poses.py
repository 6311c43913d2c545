"""Where bones have to be in the armature's space, worked out apart from the program, and where Blender has them.

What moves a bone in the space of its channels is `oracle.expected_bases`; what its place at rest, its parents and its
settings make of that is here, in NumPy. Matrices are (m, 4, 4) in the armature's space, frames are the scene's.

A bone swings over its reach: the largest distance of its head from the armature's origin in all that is compared, and
at least its own length. Blender takes bones that have constraints, whichever, through the world's space, in single
precision: where the armature is away from the world's origin, that distance, in the armature's units, is added.
Heads are compared in parts of the reach. Axes, which are 1 long where a bone has its own size, are compared as they
are, so what is within the reach around the head is off by about that part of it at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np

from tests.animation.keyed import key_frames
from tests.animation.oracle import expected_bases, play, shortest_quaternion, shown_worlds

TOLERANCE = 1e-5

Poses = dict[str, np.ndarray]
"""Matrices of bones by their names."""


def shown_poses(rigs: Iterable[bpy.types.Object], frames: Sequence[float]) -> list[Poses]:
    """All bones of rigs by name, as the scene evaluates them. It returns to its frame."""
    rigs, scene = list(rigs), bpy.context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    shown = [{name: np.empty((len(frames), 4, 4)) for name in names_of(rig)} for rig in rigs]
    for row, frame in enumerate(frames):
        play(rigs, frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for result, rig in zip(shown, rigs, strict=True):
            evaluated = rig.evaluated_get(depsgraph).pose.bones
            for name, matrices in result.items():
                matrices[row] = evaluated[name].matrix
    scene.frame_set(before, subframe=subframe)
    return shown


def placed(rig: bpy.types.Object) -> np.ndarray:
    """Where the bones of a rig are seen now, in the space of the armature, shape (bones, 4, 4)."""
    bpy.context.view_layer.update()
    bones = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
    return np.array([bone.matrix for bone in bones])


def seen(rig: bpy.types.Object, name: str) -> np.ndarray:
    """Where one of them is seen, shape (4, 4)."""
    return placed(rig)[rig.pose.bones.find(name)]


def names_of(rig: bpy.types.Object) -> list[str]:
    return [pose_bone.name for pose_bone in rig.pose.bones]


def expected_poses(rig: bpy.types.Object, frames: Sequence[float], bones: Iterable[str] | None = None) -> Poses:
    """These bones by name, or all, and their parents, from their channels, modes, parents and settings."""
    frames, result = np.asarray(frames, dtype=np.float64), {}
    asked = [rig.pose.bones[name] for name in (names_of(rig) if bones is None else bones)]
    needed = {item.name for bone in asked for item in (bone, *bone.parent_recursive)}
    for pose_bone in (bone for bone in rig.pose.bones if bone.name in needed):
        basis = expected_bases(pose_bone, frames)
        parent = None if pose_bone.parent is None else result[pose_bone.parent.name]
        result[pose_bone.name] = _placed(pose_bone.bone, basis, parent)
    return result


def _placed(bone: bpy.types.Bone, basis: np.ndarray, parent: np.ndarray | None) -> np.ndarray:
    """A bone from the matrices of its channels and those of its parent. Parents that shear need the scale inherited."""
    rest = np.array(bone.matrix_local)
    if parent is None:
        place, axes = (np.eye(4) if not bone.use_local_location else rest), rest[:3, :3]
        made = np.tile(np.eye(4), (len(basis), 1, 1))
        made[:, :3, :3] = axes @ basis[:, :3, :3]
        made[:, :3, 3] = rest[:3, 3] + basis[:, :3, 3] @ place[:3, :3].T
        return made
    above = np.array(bone.parent.matrix_local)
    offset = np.linalg.inv(above) @ rest
    held = parent[:, :3, :3]
    size = np.linalg.norm(held, axis=1)
    post = np.ones((len(basis), 3))
    turning = held / size[:, None, :] if bone.use_inherit_rotation else np.tile(above[:3, :3], (len(basis), 1, 1))
    if bone.inherit_scale in ("FULL", "FIX_SHEAR"):
        turning = turning * size[:, None, :]
    elif bone.inherit_scale == "AVERAGE":
        turning = turning * np.cbrt(np.linalg.det(held))[:, None, None]
    elif bone.inherit_scale == "ALIGNED":
        post = size
    made = np.tile(np.eye(4), (len(basis), 1, 1))
    made[:, :3, :3] = turning @ offset[:3, :3] @ basis[:, :3, :3] * post[:, :, None]
    moved = basis[:, :3, 3] * (not bone.use_connect)
    way = held @ offset[:3, :3] if bone.use_local_location else held
    made[:, :3, 3] = (parent @ offset)[:, :3, 3] + np.einsum("mij,mj->mi", way, moved)
    return made


def assert_posed(rig: bpy.types.Object, frames: Sequence[float], bones: Iterable[str] | None = None) -> None:
    """The scene shows these bones of a rig, by default all, where they have to be."""
    (shown,) = shown_poses([rig], frames)
    assert_same_poses(rig, frames, shown, expected_poses(rig, frames, bones=bones), bones)


def assert_same_poses(
    rig: bpy.types.Object,
    frames: Sequence[float],
    shown: Poses,
    expected: Poses,
    bones: Iterable[str] | None = None,
    tolerance: float = TOLERANCE,
) -> None:
    """To this part of each bone's reach.

    Where Blender's own quaternion passes near zero on its way, what single precision leaves of its direction is less,
    and no difference can mend that: the tolerance grows by the same factor.
    """
    away = _distance_from_world(rig, frames)
    for name in expected if bones is None else bones:
        pose_bone = rig.pose.bones[name]
        error = deviation(shown[name], expected[name], pose_bone.bone.length, away)
        error = error * shortest_quaternion(pose_bone, frames)
        worst = int(np.argmax(error))
        assert error[worst] < tolerance, (
            f"{rig.name}, {name} ({pose_bone.rotation_mode}) is off by {error[worst]:.3g} of its reach on frame "
            f"{frames[worst]} (keys on {key_frames(pose_bone)[:20]}):\n{shown[name][worst]}\ninstead of\n"
            f"{expected[name][worst]}"
        )


def deviation(shown: np.ndarray, expected: np.ndarray, length: float, away: float = 0.0) -> np.ndarray:
    """How far a bone of this length is off on each frame, in parts of its reach."""
    reach = max(length, np.linalg.norm(expected[:, :3, 3], axis=1).max(initial=0.0)) + away
    moved = np.linalg.norm(shown[:, :3, 3] - expected[:, :3, 3], axis=1) / reach
    size = max(1.0, np.abs(expected[:, :3, :3]).max(initial=0.0))
    turned = np.abs(shown[:, :3, :3] - expected[:, :3, :3]).max(axis=(1, 2), initial=0.0) / size
    return np.maximum(moved, turned)


def _distance_from_world(rig: bpy.types.Object, frames: Sequence[float]) -> float:
    """How far the armature is from the world's origin where it is furthest, in the units of its smallest axis."""
    worlds = shown_worlds([rig], [frames[0], frames[len(frames) // 2], frames[-1]])[0]
    return float(max(np.linalg.norm(world[:3, 3]) / np.linalg.norm(world[:3, :3], axis=0).min() for world in worlds))
