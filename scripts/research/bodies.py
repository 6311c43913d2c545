"""Whole bodies as Blender imports them: what the F-curves of an armature show, and what is left of it by few keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation.actions.channels import replace_keys
from rigid_motion.animation.transforms.bones import prefix_of
from rigid_motion.motion import Poses, Skeleton, interpolate, shell_error
from rigid_motion.motion.eulers import quaternions_from_extrinsic_eulers
from rigid_motion.motion.poses import placed
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion_batch.hushing import hushed
from rigid_motion_batch.scenes.decimated_bodies import Curve, key_frames_of, values_of, varying

RADIUS = 0.03
"""Of the ball at every joint, in metres."""

IMPORTERS = {".bvh", ".fbx"}

MOST_FRAMES = 1200
"""Longer recordings are cut off."""

CHANNELS = {"location": 3, "rotation_quaternion": 4, "rotation_euler": 3}


Keys = Sequence[np.ndarray]
"""The samples that are keys, for each joint."""


@dataclass(frozen=True, eq=False)
class Body:
    """A body with a pose on every frame."""

    name: str
    rate: float
    """Frames a second."""

    joints: tuple[str, ...]
    parents: np.ndarray
    """Shape (joints,), -1 for roots."""

    poses: Poses
    """Shape (joints, n), each in its parent's space; z is up in that of roots. In metres."""

    moving: np.ndarray
    """How many channels of each joint's location ever change, shape (joints,)."""

    turning: np.ndarray
    """How many of its rotation."""

    enlarged: float = 1.0
    """How many times larger than in the file."""

    @property
    def frames(self) -> int:
        return self.poses.shape[1]

    @property
    def times(self) -> np.ndarray:
        return np.arange(self.frames) / self.rate

    @cached_property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.parents)

    @cached_property
    def truth(self) -> Poses:
        """Where the joints are, shape (joints, n)."""
        return self.skeleton.in_root_space(self.poses)

    @property
    def extent(self) -> float:
        """The largest extent of the joints in the first frame, along any of the three axes."""
        return float(np.ptp(self.truth.positions[:, 0], axis=0).max())

    def of_size(self, extent: float) -> Body:
        """The same body, larger or smaller."""
        factor = extent / self.extent
        poses = Poses(factor * self.poses.positions, self.poses.quaternions)
        return replace(self, poses=poses, enlarged=factor * self.enlarged)

    def shown(self, keys: Keys, mode: str) -> Poses:
        """Where the joints are by their keys, shape (joints, n)."""
        shown = self.poses.copy()
        for joint, own in enumerate(keys):
            shown[joint] = interpolate(self.times[own], self.poses[joint][own], self.times, mode)
        return self.skeleton.in_root_space(shown)

    def shown_by_key_poses(self, keys: np.ndarray, mode: str) -> Poses:
        """The same where all joints have keys at the same samples."""
        return self.skeleton.in_root_space(interpolate(self.times[keys], self.poses[:, keys], self.times, mode))

    def errors(self, shown: Poses, radius: float = RADIUS) -> np.ndarray:
        """The largest displacement of any point in the balls, shape (joints, n)."""
        return shell_error(shown, self.truth, radius)


class UnusableRigError(ValueError):
    """A file without a body that can be measured."""


@dataclass(frozen=True, eq=False)
class _Joint:
    """A bone; or the armature itself, where it carries the body along."""

    name: str
    carrier: bpy.types.Object | bpy.types.PoseBone
    parent: int
    rest: Poses
    """What its channels are put on top of, in the parent's space, shape (1,)."""

    @property
    def prefix(self) -> str:
        return "" if isinstance(self.carrier, bpy.types.Object) else prefix_of(self.carrier.name)

    @property
    def location(self) -> str:
        return f"{self.prefix}location"

    @property
    def rotation(self) -> str:
        by_quaternion = self.carrier.rotation_mode == "QUATERNION"
        return f"{self.prefix}rotation_{'quaternion' if by_quaternion else 'euler'}"


class Rig:
    """An armature in the open file, with F-curves of its own and its bones'."""

    def __init__(self, name: str, obj: bpy.types.Object, frames: np.ndarray) -> None:
        self.name, self.obj, self.frames = name, obj, frames
        self.varying = varying(values_of(obj, frames))
        """The F-curves that change, and count."""
        if any(path.endswith("scale") for path, _ in self.varying):
            raise UnusableRigError(f"{name}: its joints grow or shrink, which is not measured here")
        self.joints = self._joints()

    def body(self) -> Body:
        """As it was imported, in metres."""
        scene = bpy.context.scene
        moving, turning = (
            np.array([self._count(path) for path in paths])
            for paths in ([j.location for j in self.joints], [j.rotation for j in self.joints])
        )
        return Body(
            self.name,
            scene.render.fps / scene.render.fps_base,
            tuple(joint.name for joint in self.joints),
            np.array([joint.parent for joint in self.joints]),
            self.poses(),
            moving,
            turning,
        )

    def poses(self) -> Poses:
        """What the F-curves show now, shape (joints, n), each joint in its parent's space."""
        values, of_size = values_of(self.obj, self.frames), float(np.mean(self.obj.scale))
        rows = [placed(joint.rest, self._local(joint, values)) for joint in self.joints]
        positions = np.stack([row.positions for row in rows])
        in_bones = np.array([isinstance(joint.carrier, bpy.types.PoseBone) for joint in self.joints])
        positions[in_bones] *= of_size
        return Poses(positions, align_signs(np.stack([row.quaternions for row in rows])))

    def keys(self) -> dict[Curve, list[float]]:
        """The frames of the keys of all F-curves that vary in the recording."""
        return key_frames_of(self.obj, self.varying)

    def _local(self, joint: _Joint, values: dict[Curve, np.ndarray]) -> Poses:
        """What a joint's channels say, shape (n,)."""

        def channels(path: str, property_value: bpy.types.bpy_prop_array) -> np.ndarray:
            constant = [np.full(len(self.frames), value) for value in property_value]
            return np.stack([values.get((path, i), column) for i, column in enumerate(constant)], axis=-1)

        kind = joint.rotation.removeprefix(joint.prefix)
        turns = channels(joint.rotation, getattr(joint.carrier, kind))
        if kind == "rotation_euler":
            turns = quaternions_from_extrinsic_eulers(turns, joint.carrier.rotation_mode)
        return Poses(channels(joint.location, joint.carrier.location), normalise(turns))

    def _count(self, path: str) -> int:
        return sum((path, i) in self.varying for i in range(4))

    def _joints(self) -> list[_Joint]:
        still = Poses(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
        carries = any(path in CHANNELS for path, _ in self.varying)
        joints = [_Joint(self.obj.name, self.obj, -1, still)] if carries else []
        under = still if carries else Poses(still.positions, _pose(self.obj.matrix_basis).quaternions)
        numbers: dict[str, int] = {}
        for bone in self.obj.pose.bones:  # Parents before their children.
            numbers[bone.name] = len(joints)
            if bone.parent:
                parent = numbers[bone.parent.name]
                rest = _pose(bone.parent.bone.matrix_local.inverted() @ bone.bone.matrix_local)
            else:
                parent, rest = 0 if carries else -1, placed(under, _pose(bone.bone.matrix_local))
            joints.append(_Joint(bone.name, bone, parent, rest))
        return joints


def import_rig(path: Path, most_frames: int = MOST_FRAMES) -> Rig:
    """The armature of a file, alone in a new Blender file, imported as users do; of BVH, turned by quaternions.

    Raises
    ------
    UnusableRigError
        Where there is none that moves, or it does what is not measured here.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with hushed():
        if path.suffix.lower() == ".fbx":
            bpy.ops.import_scene.fbx(filepath=str(path))
        else:
            bpy.ops.import_anim.bvh(filepath=str(path), rotate_mode="QUATERNION", update_scene_fps=True)
    rigs = [obj for obj in bpy.data.objects if obj.type == "ARMATURE" and obj.animation_data]
    if not rigs:
        raise UnusableRigError(f"{path.name}: it has no armature that is animated")
    return rig_of(path.stem, max(rigs, key=lambda obj: len(obj.pose.bones)), most_frames)


def rig_of(name: str, obj: bpy.types.Object, most_frames: int = MOST_FRAMES) -> Rig:
    """An armature of the open file, with the first so many of its frames."""
    first, last = obj.animation_data.action.frame_range
    frames = np.arange(np.ceil(first), np.floor(last) + 1.0)
    if len(frames) > most_frames:
        frames = frames[:most_frames]
        for fcurve in animation.channelbag_of(obj).fcurves:
            keys = np.array([key.co for key in fcurve.keyframe_points])
            keys = keys[keys[:, 0] <= frames[-1]]
            replace_keys(fcurve, keys[:, 0], keys[:, 1])
    return Rig(name, obj, frames)


def body_files(paths: list[Path]) -> list[Path]:
    """The bodies among files and in folders."""
    found = [inside for path in paths for inside in (sorted(path.iterdir()) if path.is_dir() else [path])]
    return [path for path in found if path.suffix.lower() in IMPORTERS]


def _pose(matrix: object) -> Poses:
    position, quaternion, _ = matrix.decompose()
    return Poses(np.array([position]), np.array([quaternion]))
