"""A new file with the extension switched on, in which an overlay that fails makes the test fail."""

from __future__ import annotations

import logging

import bpy
import pytest

import addon


@pytest.fixture
def scene(empty_file: bpy.types.Context, caplog: pytest.LogCaptureFixture) -> bpy.types.Scene:
    """The scene of a new file without objects."""
    addon.register()
    try:
        yield empty_file.scene
    finally:
        addon.unregister()
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR] == []
