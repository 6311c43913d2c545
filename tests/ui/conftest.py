"""A new file with the extension switched on, edits followed; and keyed objects to act on."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import write_channel
from tests.animation.keyed import curves_of
from tests.animation.scenes import new_object

FRAMES = np.array((1.0, 11.0, 21.0, 41.0))


@pytest.fixture
def tool(extension) -> bpy.types.Object:
    """A selected object with four keys."""
    return keyed("Tool")


def keyed(name: str, rotation_mode: str = "QUATERNION") -> bpy.types.Object:
    """A selected, active object, moved along x and turned a quarter about z from each key to the next."""
    obj = new_object(name, rotation_mode)
    angles = np.arange(len(FRAMES)) * np.pi / 2.0
    write_channel(obj, "location", FRAMES, np.outer(np.arange(len(FRAMES)), (2.0, 0.0, 0.0)))
    if rotation_mode == "QUATERNION":
        half, zero = 0.5 * angles, np.zeros(len(FRAMES))
        write_channel(obj, "rotation_quaternion", FRAMES, np.stack((np.cos(half), zero, zero, np.sin(half)), axis=1))
    elif rotation_mode in ("XYZ", "ZYX"):
        write_channel(obj, "rotation_euler", FRAMES, np.outer(angles, (0.0, 0.0, 1.0)))
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def select_keys(carrier: bpy.types.Object | bpy.types.PoseBone, *frames: float) -> None:
    """Have these keys of an object or a bone selected, and no others of it."""
    for fcurve in curves_of(carrier).values():
        for key in fcurve.keyframe_points:
            key.select_control_point = key.co.x in frames
