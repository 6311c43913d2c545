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
from rigid_motion.motion.poses import inverse, placed
from rigid_motion.motion.quaternions import align_signs
from rigid_motion_batch.scenes.decimated_bodies import Curve, key_frames_of, values_of, varying
from rigid_motion_batch.silencing import silenced

RADIUS = 0.03  # of the ball at every joint, in metres
MOST_FRAMES = 1200  # longer recordings are cut off

Keys = Sequence[np.ndarray]
"""The samples that are keys, for each joint; those of key poses are one array."""


@dataclass(frozen=True, eq=False)
class Body:
    """A body with a pose on every frame, each joint in its parent's space; z is up in that of roots. In metres."""

    name: str
    rate: float  # frames a second
    joints: tuple[str, ...]
    parents: np.ndarray  # shape (joints,), -1 for roots
    poses: Poses  # shape (joints, n)
    moving: np.ndarray  # how many channels of each joint's location ever change, shape (joints,)
    turning: np.ndarray  # how many of its rotation
    enlarged: float = 1.0  # how many times larger than in the file

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
        """Return the same body, larger or smaller."""
        factor = extent / self.extent
        poses = Poses(factor * self.poses.positions, self.poses.quaternions)
        return replace(self, poses=poses, enlarged=factor * self.enlarged)

    def shown(self, keys: Keys, mode: str) -> Poses:
        """Return where the joints are by their keys, or by key poses (k,), shape (joints, n)."""
        if isinstance(keys, np.ndarray):
            return self.skeleton.in_root_space(interpolate(self.times[keys], self.poses[:, keys], self.times, mode))
        shown = self.poses.copy()
        for joint, samples in enumerate(keys):
            shown[joint] = interpolate(self.times[samples], self.poses[joint][samples], self.times, mode)
        return self.skeleton.in_root_space(shown)

    def errors(self, shown: Poses, radius: float = RADIUS) -> np.ndarray:
        """Return the largest displacement of any point in the balls, shape (joints, n)."""
        return shell_error(shown, self.truth, radius)


class UnusableRigError(ValueError):
    """A file without a body that can be measured."""


class Rig:
    """An armature in the open file, on some of its frames; it is a joint itself where it carries the body along."""

    def __init__(self, name: str, obj: bpy.types.Object, frames: np.ndarray) -> None:
        self.name, self.obj, self.frames = name, obj, frames
        self.varying = varying(values_of(obj, frames))
        """The F-curves that change, and count."""
        if any(path.endswith("scale") for path, _ in self.varying):
            raise UnusableRigError(f"{name}: its joints grow or shrink, which is not measured here")
        bones = list(obj.pose.bones)  # Parents before their children.
        carries = int(any(not path.startswith("pose.bones") for path, _ in self.varying))
        self.joints = [*[obj][:carries], *bones]
        above = [bones.index(bone.parent) + carries if bone.parent else carries - 1 for bone in bones]
        self.parents = np.array([*[-1][:carries], *above])

    def body(self) -> Body:
        """Return it as it was imported, in metres."""
        prefixes = ["" if joint == self.obj else prefix_of(joint.name) for joint in self.joints]
        moving, turning = (
            np.array([sum(path.startswith(prefix + channel) for path, _ in self.varying) for prefix in prefixes])
            for channel in ("location", "rotation")
        )
        names, render = tuple(joint.name for joint in self.joints), bpy.context.scene.render
        return Body(self.name, render.fps / render.fps_base, names, self.parents, self.poses(), moving, turning)

    def poses(self) -> Poses:
        """Return what Blender shows now, shape (joints, n), each joint in its parent's space."""
        shown = np.empty((len(self.joints), len(self.frames), 4, 4))
        for number, frame in enumerate(self.frames.tolist()):
            bpy.context.scene.frame_set(int(frame))
            world = self.obj.matrix_world
            shown[:, number] = [world if joint == self.obj else world @ joint.matrix for joint in self.joints]
        worlds = Poses.from_matrices(shown)
        poses = Poses(worlds.positions, worlds.quaternions)
        for joint, parent in reversed(list(enumerate(self.parents))):  # Children before their parents.
            if parent >= 0:
                poses[joint] = placed(inverse(poses[parent]), poses[joint])
        return Poses(poses.positions, align_signs(poses.quaternions))

    def keys(self) -> dict[Curve, list[float]]:
        """Return the frames of the keys of all F-curves that vary in the recording."""
        return key_frames_of(self.obj, self.varying)


def import_rig(path: Path, most_frames: int = MOST_FRAMES) -> Rig:
    """Import the armature of a file into a new Blender file, with its first frames; of BVH, turned by quaternions.

    Raises
    ------
    UnusableRigError
        Where there is none that moves, or it does what is not measured here.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with silenced():
        if path.suffix.lower() == ".fbx":
            bpy.ops.import_scene.fbx(filepath=str(path))
        else:
            bpy.ops.import_anim.bvh(filepath=str(path), rotate_mode="QUATERNION", update_scene_fps=True)
    rigs = [obj for obj in bpy.data.objects if obj.type == "ARMATURE" and obj.animation_data]
    if not rigs:
        raise UnusableRigError(f"{path.name}: it has no armature that is animated")
    rig = max(rigs, key=lambda obj: len(obj.pose.bones))
    first, last = rig.animation_data.action.frame_range
    frames = np.arange(np.ceil(first), np.floor(last) + 1.0)
    if len(frames) > most_frames:
        frames = frames[:most_frames]
        for fcurve in animation.channelbag_of(rig).fcurves:
            keys = np.array([key.co for key in fcurve.keyframe_points])
            keys = keys[keys[:, 0] <= frames[-1]]
            replace_keys(fcurve, keys[:, 0], keys[:, 1])
    return Rig(path.stem, rig, frames)
