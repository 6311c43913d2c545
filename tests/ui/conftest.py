"""Fixtures for the interface: a new file with the extension registered and live updates on, and keyed objects."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from rigid_motion.ui.overlay import drawing
from tests.animation.keyed import curves_of
from tests.animation.scenes import turning
from tests.complaints import complaints

FRAMES = np.array((1.0, 11.0, 21.0, 41.0))


@pytest.fixture
def scene(
    extension: bpy.types.Context, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> Iterator[bpy.types.Scene]:
    """The scene of a new file without objects, paths shown. An error of the overlay fails the test."""
    # An error that was logged in an earlier test is logged again.
    monkeypatch.setattr(drawing, "_complaint", "")
    extension.scene.rigid_motion_overlay.show_paths = True
    yield extension.scene
    assert complaints(caplog) == []


@pytest.fixture
def tool(extension) -> bpy.types.Object:
    """A selected object with four keys."""
    return keyed("Tool")


def keyed(name: str, rotation_mode: str = "QUATERNION") -> bpy.types.Object:
    """Return a selected, active object that moves along x and turns a quarter about z from key to key."""
    obj = turning(name, 90.0 * np.arange(len(FRAMES)), FRAMES, rotation_mode)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def select_keys(carrier: bpy.types.Object | bpy.types.PoseBone, *frames: float) -> None:
    """Select the keys of an object or a bone on these frames, and deselect all others of it."""
    for fcurve in curves_of(carrier).values():
        for key in fcurve.keyframe_points:
            key.select_control_point = key.co.x in frames
