"""A new file with the extension switched on, in which an overlay that fails makes the test fail."""

from __future__ import annotations

import bpy
import pytest

import rigid_motion
from rigid_motion.ui.overlay import drawing
from tests.complaints import complaints


@pytest.fixture
def scene(
    empty_file: bpy.types.Context, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> bpy.types.Scene:
    """The scene of a new file without objects."""
    # What was complained of before is complained of again.
    monkeypatch.setattr(drawing, "_complaint", "")
    rigid_motion.register()
    try:
        yield empty_file.scene
    finally:
        rigid_motion.unregister()
    assert complaints(caplog) == []
