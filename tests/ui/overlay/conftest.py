"""A new file with the extension switched on, in which an overlay that fails makes the test fail."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest

from rigid_motion.ui.overlay import drawing
from tests.complaints import complaints


@pytest.fixture
def scene(
    extension: bpy.types.Context, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> Iterator[bpy.types.Scene]:
    """The scene of a new file without objects."""
    # What was complained of before is complained of again.
    monkeypatch.setattr(drawing, "_complaint", "")
    yield extension.scene
    assert complaints(caplog) == []
