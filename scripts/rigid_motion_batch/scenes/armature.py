"""Armatures of figures: bones as an ordinary rig, and the figure's motion in the channels of these bones.

A bone begins at its joint and points along y to the end of the joint's bone, so bone and joint differ by a constant
rotation. This does not affect interpolation: every mode gives the same motion in a rigidly attached frame.
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
"""Minimum length of a bone, as a fraction of the figure's size: Blender removes bones of zero length."""

MAX_STEADY_CHANGE = 1e-5
"""Metres, or units of a quaternion component: a channel that varies less is set instead of keyed."""

REST_QUATERNION = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class RestFigure:
    """A figure at rest, in Blender's axes and metres, parents before their children."""

    parents: np.ndarray
    """Shape (joints,), -1 for roots."""

    joints: Poses
    """Shape (joints,), in the space of the armature."""

    tails: np.ndarray
    """The ends of the joints' bones, in the same space: shape (joints, 3)."""

    aside: np.ndarray
    """True for joints that only carry the others, or stand where the others move, shape (joints,)."""

    origin: np.ndarray
    """The origin of the armature's space in the figure's world: below the figure, on the ground. Shape (3,)."""

    @classmethod
    def of(cls, clip: Clip) -> RestFigure:
        """Return the figure of a clip; the clip may be in any unit and axes, with a rest pose anywhere."""
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
    """An armature of a figure, and the transforms that convert joint poses to its channels.

    Parameters
    ----------
    name : str
    rest : Rest
    names : iterable of str
        The names of its bones; Blender may shorten and number them.
    collection : bpy.types.Collection
        The collection for the object: one in the shown scene.
    like : Rig, optional
        A rig with the same rest pose, to share bones with.
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
        self.bones: tuple[str, ...] = like.bones if like else _make_bones(self.obj, rest, names)
        view_layer().update()  # This creates the pose.
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
        """Return the channels of all bones for poses of their joints in their parents' space, shape (joints, n)."""
        return placed(self._before[:, None], placed(joints, self._after[:, None]))

    def channels_of_bone(self, bone: int, joint: Poses) -> Poses:
        """Return the channels of one bone for poses of its joint, shape (n,)."""
        return placed(self._before[bone], placed(joint, self._after[bone]))

    def joints_of(self, channels: Poses) -> Poses:
        """Return the joints in their parents' space for these channels of the bones, shape (joints, n)."""
        return placed(inverse(self._before)[:, None], placed(channels, inverse(self._after)[:, None]))

    def key(self, bone: int, frames: np.ndarray, channels: Poses) -> None:
        """Key a bone at frames (n,), or just set it if it does not vary; the channels have shape (n,)."""
        pose_bone = pose_bones(self.obj)[self.bones[bone]]
        quaternions = align_signs(channels.quaternions)
        for name, values in (("location", channels.positions), ("rotation_quaternion", quaternions)):
            if len(values) > 1 and np.ptp(values, axis=0).max() > MAX_STEADY_CHANGE:
                path = pose_bone.path_from_id(name)
                animation.write_channel(self.obj, path, frames, values, group=pose_bone.name)
            else:
                setattr(pose_bone, name, values[0])

    def fill_in(self, mode: str) -> None:
        """Set the mode, one of `KEYFRAME_MODES`, that interpolates between the keys of all bones."""
        if mode not in KEYFRAME_MODES:
            raise ValueError(f"{mode} is not a mode of keys")
        keyed = [bone for bone in pose_bones(self.obj) if len(animation.key_frames(bone))]
        if keyed:
            animation.set_mode(keyed, mode)


def _make_bones(obj: bpy.types.Object, rest: RestFigure, names: Iterable[str]) -> tuple[str, ...]:
    """Make the bones of an armature, and return their names."""
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
