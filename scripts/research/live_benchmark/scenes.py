"""Files with animated objects, and Blender's own baking of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import bpy
import numpy as np
from bpy_extras import anim_utils

from rigid_motion import animation

MODE = "dq_sclerp"
"""The mode that is measured: the screw mode."""

ROTATION_MODES = ("QUATERNION", "XYZ")


@dataclass(frozen=True)
class Size:
    """Of a scene: its objects, the keys of each on all channels, and the frames from the first key to the last."""

    objects: int
    keys: int
    frames: int

    def __str__(self) -> str:
        return f"{self.objects} objects, {self.keys} keys, {self.frames} frames"


def general(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """A location and a rotation about any axis; the rotation a quaternion or Euler angles, by its width."""
    return random.normal(size=3), random.normal(size=width)


def planar(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """A location in the plane of x and y, and a rotation about z."""
    x, y, angle = random.normal(size=3)
    turned = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)) if width == 4 else (0.0, 0.0, angle)
    return np.array((x, y, 0.0)), np.array(turned)


Target = TypeVar("Target", bpy.types.Object, bpy.types.PoseBone)

Pose = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]

MOTIONS: dict[str, Pose] = {"about general axes": general, "in a plane": planar}


def scene_of(size: Size, rotation_mode: str, pose: Pose = general) -> list[bpy.types.Object]:
    """A new file with animated empties."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, size.frames
    random = np.random.default_rng(5)
    made = [
        keyed(new_empty(f"Tool {number}"), size, rotation_mode, partial(pose, random)) for number in range(size.objects)
    ]
    bpy.context.view_layer.update()
    return made


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
    obj = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(obj)
    return obj


def set_modes(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], mode: str) -> None:
    animation.set_mode(targets, mode)
    bpy.context.view_layer.update()


def forget_digests() -> None:
    """Have nothing be filled in, for all that the extension knows."""
    for action in bpy.data.actions:
        for record in action.rigid_motion.slots:
            record.digest = ""


def all_frames() -> range:
    return range(bpy.context.scene.frame_start, bpy.context.scene.frame_end + 1)


class NativeBaking:
    """Blender's own baking of objects as they are, or of their bones: what they show, to keys in new Actions. And the
    way back."""

    def __init__(
        self,
        objects: Sequence[bpy.types.Object],
        frames: range,
        *,
        every_channel: bool = False,
        of_bones: bool = False,
    ) -> None:
        self.objects, self.frames = objects, frames
        self.played = [(obj.animation_data.action, obj.animation_data.action_slot) for obj in objects]
        self.options = anim_utils.BakeOptions(
            only_selected=False,
            do_pose=of_bones,
            do_object=not of_bones,
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
        anim_utils.bake_action_objects(
            [(obj, None) for obj in self.objects], frames=self.frames, bake_options=self.options
        )

    def restore(self) -> None:
        """Have the objects move by what they moved by before, and remove what was baked."""
        for obj, (action, slot) in zip(self.objects, self.played, strict=True):
            baked = obj.animation_data.action
            obj.animation_data.action, obj.animation_data.action_slot = action, slot
            if baked != action:
                bpy.data.actions.remove(baked)
        bpy.context.view_layer.update()
