"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension."""

from __future__ import annotations

import bpy
import numpy as np

from ..motion import Poses
from ..motion.eulers import ORDERS, eulers_from_quaternions
from ..motion.quaternions import align_signs
from .channels import write_channel


def bake_poses(obj: bpy.types.Object, frames: np.ndarray, poses: Poses, *, key_type: str = "GENERATED") -> None:
    """Key `obj` with one pose per frame, straight lines between them.

    Parameters
    ----------
    obj : bpy.types.Object
        With rotation mode Quaternion or Euler of any order. Its location, rotation and (where poses have scales) scale
        channels are replaced.
    frames : array, shape (n,)
        Rising; sub-frames allowed.
    poses : Poses, shape (n,)
        In the object's parent space: the channels' own.
    key_type : str
        GENERATED, as Blender has it for keys that a program made and may remove again.

    Raises
    ------
    ValueError
        Where the object turns by axis and angle, or frames and poses differ in number.
    """
    if poses.shape != np.shape(frames):
        raise ValueError(f"{obj.name}: {np.shape(frames)} frames do not fit poses of shape {poses.shape}")
    channels = [("location", poses.positions), _rotation(obj, poses.quaternions)]
    if poses.scales is not None:
        channels.append(("scale", np.repeat(poses.scales[:, None], 3, axis=1)))
    for data_path, values in channels:
        write_channel(obj, data_path, frames, values, key_type=key_type, group="Object Transforms")


def _rotation(obj: bpy.types.Object, quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The rotation channels of the object's mode, and their values."""
    if obj.rotation_mode == "QUATERNION":
        return "rotation_quaternion", align_signs(quaternions)
    if obj.rotation_mode in ORDERS:
        return "rotation_euler", eulers_from_quaternions(quaternions, obj.rotation_mode)
    raise ValueError(
        f"{obj.name}: rotation by axis and angle cannot be baked; set its rotation mode to Quaternion first"
    )
