"""Blender in the test process: `bpy` first, since `mathutils` comes with it, and an empty file for whoever asks."""

from __future__ import annotations

import bpy
import pytest


@pytest.fixture
def empty_file() -> bpy.types.Context:
    """A new file without objects, at factory settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context
