"""Files with animated objects and rigs for `benchmark_live`, and Blender's own baking of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TypeVar

import bpy
import numpy as np
from bpy_extras import anim_utils

from rigid_motion import animation

MODE = "dq_sclerp"
"""The mode that is measured: the screw mode."""

ROTATION_MODES = ("QUATERNION", "XYZ")

CHAIN, RING = 10, 20
"""Bones from root to tip, and vertices of the skin around a bone."""

Target = TypeVar("Target", bpy.types.Object, bpy.types.PoseBone)

Pose = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]
"""A location and a rotation, a quaternion or Euler angles by its width."""


@dataclass(frozen=True)
class Size:
    """Objects or bones, the keys of each on all channels, the frames from the first key to the last, and the skin."""

    objects: int
    keys: int
    frames: int
    vertices: int = 0


def general(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Turned about any axis."""
    return random.normal(size=3), random.normal(size=width)


def planar(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """In the plane of x and y, turned about z."""
    x, y, angle = random.normal(size=3)
    turned = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)) if width == 4 else (0.0, 0.0, angle)
    return np.array((x, y, 0.0)), np.array(turned)


MOTIONS: dict[str, Pose] = {"about general axes": general, "in a plane": planar}


def new_scene(frames: int) -> bpy.types.Scene:
    """A new file with so many frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    return scene


def scene_of(size: Size, rotation_mode: str, pose: Pose = general) -> list[bpy.types.Object]:
    """A new file with animated empties."""
    new_scene(size.frames)
    random = np.random.default_rng(5)
    made = [keyed(new_empty(f"Tool {i}"), size, rotation_mode, partial(pose, random)) for i in range(size.objects)]
    bpy.context.view_layer.update()
    return made


def rig_of(size: Size) -> bpy.types.Object:
    """A new file with an armature whose bones all have keys of location and rotation."""
    scene = new_scene(size.frames)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(size.objects):
        chain, place = divmod(number, CHAIN)
        bone = rig.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (chain, 0.0, place), (chain, 0.0, place + 1.0)
        bone.parent = rig.data.edit_bones[f"Bone {number - 1}"] if place else None
    bpy.ops.object.mode_set(mode="OBJECT")
    random = np.random.default_rng(5)
    for bone in rig.pose.bones:
        keyed(bone, size, "QUATERNION", partial(general, random))
    bpy.context.view_layer.update()
    return rig


def add_skin(rig: bpy.types.Object, count: int) -> bpy.types.Object:
    """A mesh of about so many vertices that the bones deform, two for each vertex: a tube along each chain."""
    bones = rig.data.bones
    rings = max(2, round(count / (RING * math.ceil(len(bones) / CHAIN))))
    turns = 2.0 * np.pi * np.arange(RING) / RING
    skin = bpy.data.objects.new("Skin", bpy.data.meshes.new("Skin"))
    groups = [skin.vertex_groups.new(name=bone.name) for bone in bones]
    points, faces, weights = [], [], []
    for first in range(0, len(bones), CHAIN):
        length = min(CHAIN, len(bones) - first)
        for along in np.linspace(0.0, length, rings):
            # From the middle of a bone to the middle of the next, the one hands over to the other.
            behind = min(max(along - 0.5, 0.0), length - 1.0)
            lower = min(int(behind), max(length - 2, 0))
            numbers = list(range(len(points), len(points) + RING))
            weights.append((first + lower, numbers, 1.0 - (behind - lower)))
            if length > 1:
                weights.append((first + lower + 1, numbers, behind - lower))
            if along:
                around = [*numbers, numbers[0]]
                faces += [(a - RING, a, b, b - RING) for a, b in pairwise(around)]
            points += [(first // CHAIN + 0.3 * np.cos(turn), 0.3 * np.sin(turn), along) for turn in turns]
    skin.data.from_pydata(points, [], faces)
    for bone, numbers, weight in weights:
        groups[bone].add(numbers, weight, "REPLACE")
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.scene.collection.objects.link(skin)
    bpy.context.view_layer.update()
    return skin


def keyed(
    target: Target, size: Size, rotation_mode: str, pose: Callable[[int], tuple[np.ndarray, np.ndarray]]
) -> Target:
    """Insert keys of these poses, evenly over the frames."""
    rotation = "rotation_quaternion" if rotation_mode == "QUATERNION" else "rotation_euler"
    target.rotation_mode = rotation_mode
    for frame in np.linspace(1, size.frames, size.keys).round():
        target.location, turned = pose(len(getattr(target, rotation)))
        setattr(target, rotation, turned)
        target.keyframe_insert("location", frame=frame)
        target.keyframe_insert(rotation, frame=frame)
    return target


def new_empty(name: str) -> bpy.types.Object:
    """An empty in the scene."""
    obj = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(obj)
    return obj


def set_modes(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], mode: str) -> None:
    """Choose a mode, and update the view."""
    animation.set_mode(targets, mode)
    bpy.context.view_layer.update()


class NativeBaking:
    """Blender's own baking of objects, or of their bones: what they show, to keys in new Actions. And the way back."""

    def __init__(
        self, objects: Sequence[bpy.types.Object], *, every_channel: bool = False, bones: bool = False
    ) -> None:
        scene = bpy.context.scene
        self.objects, self.frames = objects, range(scene.frame_start, scene.frame_end + 1)
        self.played = [(obj.animation_data.action, obj.animation_data.action_slot) for obj in objects]
        self.options = anim_utils.BakeOptions(
            only_selected=False,
            do_pose=bones,
            do_object=not bones,
            do_visual_keying=True,
            do_constraint_clear=False,
            do_parents_clear=False,
            do_clean=False,
            do_location=True,
            do_rotation=True,
            do_scale=every_channel,
            do_bbone=every_channel,
            do_custom_props=every_channel,
        )

    def bake(self) -> None:
        """Bake; following edits has to be off."""
        pairs = [(obj, None) for obj in self.objects]
        anim_utils.bake_action_objects(pairs, frames=self.frames, bake_options=self.options)

    def restore(self) -> None:
        """Have the objects move by what they moved by before, and remove what was baked."""
        for obj, (action, slot) in zip(self.objects, self.played, strict=True):
            baked = obj.animation_data.action
            obj.animation_data.action, obj.animation_data.action_slot = action, slot
            if baked != action:
                bpy.data.actions.remove(baked)
        bpy.context.view_layer.update()
