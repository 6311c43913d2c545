"""A fixture with Rigify's human, and the extension's handlers registered."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest

from rigid_motion import animation


@pytest.fixture
def rig(human: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Rigify's human, with the extension's handlers registered."""
    animation.register()
    yield human
    animation.unregister()
