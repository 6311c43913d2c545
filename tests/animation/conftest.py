"""Fixture for a new file with live in-betweens. Handlers that fail make the test fail."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import bpy
import pytest

from rigid_motion import animation
from tests.complaints import complaints


@pytest.fixture
def live_file(empty_file, caplog: pytest.LogCaptureFixture) -> Iterator[bpy.types.Context]:
    """A new file without objects, with edits followed."""
    animation.register()
    try:
        with caplog.at_level(logging.WARNING):
            yield empty_file
    finally:
        animation.set_enabled(True)
        animation.unregister()
    assert complaints(caplog) == []
