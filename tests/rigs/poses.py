"""Random keys on rigs, and the resulting bone positions."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Euler, Quaternion

KEYS = (1, 15, 31)


def key_at_random(bones: Iterable[bpy.types.PoseBone]) -> None:
    """Key bones on three frames with small random rotations, and locations unless locked."""
    random, bones = np.random.default_rng(0), list(bones)
    for frame in KEYS:
        for bone in bones:
            moved = random.normal(size=3) * 0.02
            bone.location = [0.0 if locked else value for locked, value in zip(bone.lock_location, moved, strict=True)]
            turned = Quaternion((1.0, *(random.normal(size=3) * 0.15))).normalized()
            bone.keyframe_insert("location", frame=frame, group=bone.name)
            if bone.rotation_mode == "QUATERNION":
                bone.rotation_quaternion = turned
                bone.keyframe_insert("rotation_quaternion", frame=frame, group=bone.name)
            else:
                bone.rotation_euler = turned.to_euler(bone.rotation_mode)
                bone.keyframe_insert("rotation_euler", frame=frame, group=bone.name)
    bpy.context.view_layer.update()


def key_controls(rig: bpy.types.Object, poses: dict[str, tuple[tuple, tuple]], frames: tuple[int, int]) -> None:
    """Key controls by name, from rest to a location and to angles about X, Y and Z."""
    for name, (location, angles) in poses.items():
        bone = rig.pose.bones[name]
        bone.rotation_mode = "QUATERNION"
        for frame, part in zip(frames, (0.0, 1.0), strict=True):
            bone.location = np.multiply(location, part)
            bone.rotation_quaternion = Euler(np.multiply(angles, part)).to_quaternion()
            for path in ("location", "rotation_quaternion", "scale"):
                bone.keyframe_insert(path, frame=frame)


def ends_of_bones(rig: bpy.types.Object) -> np.ndarray:
    """Return the heads and tails of all bones on some frames, in armature space."""
    result = []
    for frame in range(KEYS[0], KEYS[-1] + 1, 4):
        bpy.context.scene.frame_set(frame)
        result.append([(*bone.head, *bone.tail) for bone in rig.pose.bones])
    return np.array(result)
