"""Armatures: the bones of a figure as an ordinary rig, and its motion in the channels of these bones.

A bone begins at its joint and points along y to where the joint's bone ends, so it is turned from the joint by a turn
of its own. Interpolation does not mind: every mode gives the same motion in a frame that is fixed to another.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from rigid_motion import animation
from rigid_motion.blender import armature, pose_bones, view_layer
from rigid_motion.motion import KEYFRAME_MODES, Poses
from rigid_motion.motion.poses import inverse, placed
from rigid_motion.motion.quaternions import align_signs, conjugate, multiply, rotate
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.matrices import rigid
from rigid_motion_batch.recordings.rest_bodies import LOOKED_AT, carrying

LEAST_BONE = 0.02
"""A bone is no shorter than so much of the figure: Blender removes bones of no length."""

MAX_STEADY_CHANGE = 1e-5
"""Metres and parts of a quaternion: a channel that varies less is set, and not keyed."""

REST_QUATERNION = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class RestFigure:
    """A figure at rest, in Blender's axes and metres, parents before their children."""

    parents: np.ndarray
    """Shape (joints,), -1 for roots."""

    joints: Poses
    """Shape (joints,), in the space of the armature."""

    tails: np.ndarray
    """The ends of their bones, there too: shape (joints, 3)."""

    aside: np.ndarray
    """Which joints only carry the others about, or stand where they move, shape (joints,)."""

    origin: np.ndarray
    """The origin of that space in the figure's world: below it, on the ground. Shape (3,)."""

    @classmethod
    def of(cls, clip: Clip) -> RestFigure:
        """Return the figure of a clip, which may be in any unit and axes, and at rest anywhere."""
        rest_body = clip.whole_body
        joints = clip.in_blender(rest_body.rest)
        turned = np.tile(REST_QUATERNION, (len(rest_body.tails), 1))
        arms = clip.in_blender(Poses(rest_body.tails, turned)).positions
        lengths = np.linalg.norm(arms, axis=1)
        least = LEAST_BONE * max(float(np.ptp(joints.positions, axis=0).max(initial=0.0)), float(lengths.max()), 1e-3)
        short = lengths < least
        along = np.where(lengths[:, None] > 1e-9, arms / np.maximum(lengths, 1e-9)[:, None], (0.0, 1.0, 0.0))
        arms[short] = least * along[short]
        tails = joints.positions + rotate(joints.quaternions, arms)
        origin = np.append(joints.positions[:, :2].mean(axis=0), min(joints.positions[:, 2].min(), tails[:, 2].min()))
        every = -(-len(clip.times) // LOOKED_AT)
        aside = carrying(rest_body.parents, rest_body.skeleton.in_root_space(clip.poses[:, ::every]).positions)
        at_rest = Poses(joints.positions - origin, joints.quaternions)
        return cls(rest_body.parents, at_rest, tails - origin, aside, origin)


class Rig:
    """An armature of a figure, and what it takes to move it.

    Parameters
    ----------
    name : str
    rest : Rest
    names : iterable of str
        What its bones are to be called; Blender may cut and number them.
    collection : bpy.types.Collection
        What it is put into: one of the scene that is shown.
    like : Rig, optional
        One of the same rest, whose bones it shares.
    """

    def __init__(
        self,
        name: str,
        rest: RestFigure,
        names: Iterable[str],
        collection: bpy.types.Collection,
        like: Rig | None = None,
    ) -> None:
        self.obj: bpy.types.Object = bpy.data.objects.new(name, like.obj.data if like else bpy.data.armatures.new(name))
        collection.objects.link(self.obj)
        self.bones: tuple[str, ...] = like.bones if like else _with_bones(self.obj, rest, names)
        view_layer().update()  # A pose comes with it.
        for bone in pose_bones(self.obj):
            bone.rotation_mode = "QUATERNION"
        bones = armature(self.obj).bones
        there = rigid(np.array([bones[bone].matrix_local for bone in self.bones], dtype=np.float64).reshape(-1, 4, 4))
        turns = multiply(conjugate(rest.joints.quaternions), there.quaternions)
        none = np.zeros((len(turns), 3))
        above = np.where(rest.parents >= 0, rest.parents, 0)
        roots = (rest.parents < 0)[:, None]
        # A bone's channels are before * joint in its parent's space * after.
        to_parents = Poses(none, np.where(roots, REST_QUATERNION, conjugate(turns[above])))
        parents_rest = Poses(
            np.where(roots, 0.0, there.positions[above]), np.where(roots, REST_QUATERNION, there.quaternions[above])
        )
        from_rest = placed(inverse(there), parents_rest)
        self._before, self._after = placed(from_rest, to_parents), Poses(none, turns)

    def channels_of(self, joints: Poses) -> Poses:
        """Return the channels of all bones where the joints have these poses in their parents' space, shape
        (joints, n).
        """
        return placed(self._before[:, None], placed(joints, self._after[:, None]))

    def channels_of_bone(self, bone: int, joint: Poses) -> Poses:
        """Return the channels of one bone where its joint has these poses, shape (n,)."""
        return placed(self._before[bone], placed(joint, self._after[bone]))

    def joints_of(self, channels: Poses) -> Poses:
        """Return the joints in their parents' space where the bones have these channels, shape (joints, n)."""
        return placed(inverse(self._before)[:, None], placed(channels, inverse(self._after)[:, None]))

    def key(self, bone: int, frames: np.ndarray, channels: Poses) -> None:
        """Key a bone at frames (n,), or set it where it does not vary; its channels have the shape (n,)."""
        pose_bone = pose_bones(self.obj)[self.bones[bone]]
        quaternions = align_signs(channels.quaternions)
        for name, values in (("location", channels.positions), ("rotation_quaternion", quaternions)):
            if len(values) > 1 and np.ptp(values, axis=0).max() > MAX_STEADY_CHANGE:
                path = pose_bone.path_from_id(name)
                animation.write_channel(self.obj, path, frames, values, group=pose_bone.name)
            else:
                setattr(pose_bone, name, values[0])

    def fill_in(self, mode: str) -> None:
        """Have what happens between the keys of all bones be that of a mode of `KEYFRAME_MODES`."""
        if mode not in KEYFRAME_MODES:
            raise ValueError(f"{mode} is not a mode of keys")
        keyed = [bone for bone in pose_bones(self.obj) if len(animation.key_frames(bone))]
        if keyed:
            animation.set_mode(keyed, mode)


def _with_bones(obj: bpy.types.Object, rest: RestFigure, names: Iterable[str]) -> tuple[str, ...]:
    """Make the bones of an armature, and return what they are called."""
    view_layer().objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    made: list[bpy.types.EditBone] = []
    sides = rotate(rest.joints.quaternions, np.tile((0.0, 0.0, 1.0), (len(rest.parents), 1)))
    for joint, name in enumerate(names):
        bone = armature(obj).edit_bones.new(name)
        bone.head, bone.tail = rest.joints.positions[joint], rest.tails[joint]
        bone.align_roll(Vector(sides[joint]))
        bone.parent = made[rest.parents[joint]] if rest.parents[joint] >= 0 else None
        made.append(bone)
    called = tuple(bone.name for bone in made)
    bpy.ops.object.mode_set(mode="OBJECT")
    return called
