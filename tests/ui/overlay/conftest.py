"""The fixture `scene` for the overlay: a new file, in which an error of the overlay fails the test."""

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
    # An error that was logged in an earlier test is logged again.
    monkeypatch.setattr(drawing, "_complaint", "")
    yield extension.scene
    assert complaints(caplog) == []
