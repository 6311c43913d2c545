"""A body with a key on every frame, as in imported motion capture; also runs in Blender with a window."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from rigid_motion.motion.twists import exponential

FRAMES = np.arange(1.0, 91.0)
NAMES = ("Root", "Spine", "Head", "Arm.L", "Hand.L", "Arm.R", "Hand.R")
PARENTS = {"Spine": "Root", "Head": "Spine", "Arm.L": "Spine", "Hand.L": "Arm.L", "Arm.R": "Spine", "Hand.R": "Arm.R"}


def recorded_rig(rotation_mode: str = "QUATERNION", *, still: tuple[str, ...] = (), seed: int = 0) -> bpy.types.Object:
    """Return a body of a few bones with a key on every frame, as in imported motion capture."""
    rig = bpy.data.objects.new("Body", bpy.data.armatures.new("Body"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    random = np.random.default_rng(5)
    for name in NAMES:
        bone = rig.data.edit_bones.new(name)
        parent = rig.data.edit_bones.get(PARENTS.get(name, ""))
        bone.parent = parent
        bone.head = parent.tail if parent else (0.0, 0.0, 0.5)
        bone.tail = np.array(bone.head) + random.normal(size=3) * (0.1, 0.1, 0.2) + (0.0, 0.0, 0.25)
        bone.roll = 0.4
    bpy.ops.object.mode_set(mode="OBJECT")
    random = np.random.default_rng(seed)
    for name in NAMES:
        rig.pose.bones[name].rotation_mode = rotation_mode
        if name not in still:
            record(rig, name, random)
    return rig


def record(rig: bpy.types.Object, name: str, random: np.random.Generator) -> None:
    """Key a swinging bone on every frame; the root also wanders."""
    waves = random.uniform(0.05, 0.2, 3)[:, None] * FRAMES + random.uniform(0.0, 6.0, (3, 1))
    angles = 0.5 * np.sin(waves).T + 0.002 * random.normal(size=(len(FRAMES), 3))
    prefix = f'pose.bones["{name}"].'
    if rig.pose.bones[name].rotation_mode == "QUATERNION":
        turns = exponential(np.concatenate((angles.T, 0.0 * angles.T)))[0].T
        write_channel(rig, prefix + "rotation_quaternion", FRAMES, turns)
    else:
        write_channel(rig, prefix + "rotation_euler", FRAMES, angles)
    if name == "Root":
        write_channel(rig, prefix + "location", FRAMES, 0.3 * np.sin(waves[::-1]).T)
