"""Rendering of single frames of scenes to PNG, for pages and examples."""

from __future__ import annotations

from pathlib import Path

import bpy

from rigid_motion_batch.files import written_beside
from rigid_motion_batch.silencing import silenced


def render_still(scene: bpy.types.Scene, path: Path) -> None:
    """Render the current frame of a scene to a PNG.

    Raises
    ------
    RuntimeError
        If Blender writes no picture.
    """
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5 needs the kind of output first.
        image.media_type = "IMAGE"
    image.file_format = "PNG"
    image.compression = 90
    with written_beside(path) as beside, silenced():
        scene.render.filepath = str(beside)
        bpy.ops.render.render(write_still=True, scene=scene.name)
        if not beside.is_file():
            raise RuntimeError(f"{path}: Blender rendered no picture; is the disk full?")
