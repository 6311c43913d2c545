"""FBX files, binary ones, by Blender's own importer: the whole skeleton as Blender shows it.

The file tells how many frames it has a second; keys may be closer. Images that it names are not looked for.

Blender's importer makes room for whatever a file says of itself, up to hundreds of gigabytes, so it is looked first
whether its records fit one another. A record is where it ends, how many properties it has, how many bytes these take,
its name, these properties, and further records up to one that is all zeros.
Source: Blender's notes on the format, https://code.blender.org/2013/08/fbx-binary-file-format-specification/.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .importing import read_imported, refuse_too_large
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError

if TYPE_CHECKING:
    import bpy

ADDON = "io_scene_fbx"


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the whole skeleton; or bones that are named, or all."""
    refuse_too_large(path)
    refuse_damaged(path)
    return read_imported(path, selection, lambda: _import(path), ADDON, options.scale)


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


MAGIC = b"Kaydara FBX Binary  \x00\x1a\x00"

FIRST = len(MAGIC) + 4
"""Byte where the records begin, behind the version."""

SINCE_WIDE = 7500
"""Version since which places and numbers have 8 bytes each, and not 4."""

DEEPEST = 100
"""Records within records; importers go 10 deep."""


def refuse_damaged(path: Path) -> None:
    """Raise TrajectoryError where a file is no binary FBX, is cut off, or has records that do not fit one another."""
    with path.open("rb") as file:
        head = file.read(FIRST)
        if head.startswith(MAGIC) and len(head) == FIRST:
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                problem = _damage(content)
            if problem:
                problem = f"this FBX is damaged ({problem})"
                raise TrajectoryError(path, problem, "copy the file again, or export it anew")
            return
    if head and all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in head):
        raise TrajectoryError(path, "this is an FBX of text, or none", "export it as binary FBX, which Blender imports")
    raise TrajectoryError(path, "this is no FBX", "export it again")


def _damage(content: mmap.mmap) -> str:
    """Return what is wrong with the records of a file; empty for nothing."""
    (version,) = struct.unpack_from("<I", content, len(MAGIC))
    head = struct.Struct("<QQQB" if version >= SINCE_WIDE else "<IIIB")
    place, ends = FIRST, list[int]()
    try:
        while True:
            if ends and place == ends[-1] - head.size:
                place = ends.pop()
                continue
            end, count, length, name = head.unpack_from(content, place)
            if end == 0 and not ends:
                return ""
            inside = ends[-1] - head.size if ends else len(content)
            begin = place + head.size + name
            place = begin + length
            if not begin <= place <= end <= inside or count > length:
                return "a part of it is longer than the whole"
            if place < end:
                ends.append(end)
                if len(ends) > DEEPEST or end - place < head.size:
                    return "its parts are not one in another"
    except struct.error:
        return "it ends too soon"
