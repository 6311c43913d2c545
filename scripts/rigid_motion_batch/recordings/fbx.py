"""FBX files, binary ones, by Blender's own importer: the whole skeleton as Blender shows it.

The file tells how many frames it has a second; keys may be closer. Images that it names are not looked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .fbx_records import refuse_damaged
from .importing import read_imported, refuse_too_large
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory

if TYPE_CHECKING:
    import bpy

ADDON = "io_scene_fbx"


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the whole skeleton; or bones that are named, or all."""
    refuse_too_large(path)
    refuse_damaged(path)
    return read_imported(path, selection, lambda: _import(path), ADDON, _rate, options.scale)


def _rate(fps: float, keys: float | None) -> float:
    """Return the rate of the file, unless there are more keys than frames."""
    return max(fps, keys or 0.0)


def _import(path: Path) -> None:
    import bpy

    with _without_images():
        bpy.ops.import_scene.fbx(
            filepath=str(path.absolute()),
            use_image_search=False,
            use_custom_normals=False,
            use_custom_props=False,
            use_alpha_decals=False,
            colors_type="NONE",
        )


@contextmanager
def _without_images() -> Iterator[None]:
    """Keep images from being opened, wherever a stranger's file says that they are: the importer gets empty ones."""
    import bpy
    from bpy_extras import image_utils

    def empty_image(imagepath: str, *_: object, **__: object) -> bpy.types.Image:  # noqa: ARG001 - as Blender's own
        return bpy.data.images.new("Image", 1, 1)

    load_image = image_utils.load_image
    image_utils.load_image = empty_image
    try:
        yield
    finally:
        image_utils.load_image = load_image
