"""A new file with the extension switched on, edits followed; and keyed objects to act on."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.animation.keyed import curves_of
from tests.animation.scenes import turning

FRAMES = np.array((1.0, 11.0, 21.0, 41.0))


@pytest.fixture
def tool(extension) -> bpy.types.Object:
    """A selected object with four keys."""
    return keyed("Tool")


def keyed(name: str, rotation_mode: str = "QUATERNION") -> bpy.types.Object:
    """A selected, active object, moved along x and turned a quarter about z from each key to the next."""
    obj = turning(name, 90.0 * np.arange(len(FRAMES)), FRAMES, rotation_mode)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def select_keys(carrier: bpy.types.Object | bpy.types.PoseBone, *frames: float) -> None:
    """Have these keys of an object or a bone selected, and no others of it."""
    for fcurve in curves_of(carrier).values():
        for key in fcurve.keyframe_points:
            key.select_control_point = key.co.x in frames
