"""Stills of a scene, and their pixels."""

from pathlib import Path

import bpy
import numpy as np


def render_still(scene: bpy.types.Scene, path: Path, frame: int) -> None:
    scene.frame_set(frame)
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def pixels_of(path: Path) -> np.ndarray:
    """Red, green, blue and alpha of each, in rows from the foot."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels
