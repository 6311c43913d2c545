"""A scene of its own, for Blender evaluates what is hidden only for the sake of what is shown."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import bpy


@contextmanager
def probe() -> Iterator[bpy.types.Object]:
    """Yield an object that is shown in the current scene, which is new; whatever its constraints follow is evaluated.

    Both are gone afterwards.
    """
    import bpy

    stage, obj = bpy.data.scenes.new("Reading"), bpy.data.objects.new("Probe", None)
    try:
        stage.collection.objects.link(obj)
        with bpy.context.temp_override(scene=stage, view_layer=stage.view_layers[0]):
            yield obj
    finally:
        bpy.data.objects.remove(obj)
        bpy.data.scenes.remove(stage)
