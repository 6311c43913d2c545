"""Binary FBX files, read by Blender's own importer: the whole skeleton as Blender shows it.

The file states its frame rate; keys may be closer. Images that it names are not opened.

Blender's importer allocates whatever sizes a file states, up to hundreds of gigabytes. So first the records of the file
are checked for consistency. A record consists of its end, its number of properties, its name, the properties, and
nested records up to one of all zeros.
Source: Blender's notes on the format, https://code.blender.org/2013/08/fbx-binary-file-format-specification/.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from .importing import read_imported
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError
from .scene_bodies import refuse_too_large
from .tables import LARGEST_FILE

if TYPE_CHECKING:
    import bpy

ADDON = "io_scene_fbx"


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the whole skeleton, or the named bones, or all bones."""
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
    """Give the importer empty images, so that it opens no files at paths that a stranger's file names."""
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

FIRST_RECORD_BYTE = len(MAGIC) + 4
"""Byte offset of the first record, after the version."""

MIN_FBX_VERSION = 7100
"""Oldest version that Blender's importer reads."""

SINCE_WIDE = 7500
"""Version from which offsets and counts have 8 bytes instead of 4."""

MAX_RECORD_DEPTH = 100
"""Nesting depth of records; importers go 10 deep."""

BYTES_BY_TYPE = {b"Z": 1, b"C": 1, b"B": 1, b"Y": 2, b"I": 4, b"F": 4, b"D": 8, b"L": 8}
"""Bytes of properties that hold one number."""

ITEM_BYTES_BY_TYPE = {b"b": 1, b"c": 1, b"i": 4, b"l": 8, b"f": 4, b"d": 8}
"""Bytes per number in properties that hold arrays."""

MAX_EXPANSION_RATIO = 1032
"""Largest ratio of unpacked to packed bytes in zlib."""

MAX_HARMLESS_BYTES = 1 << 24
"""Bytes. Data that cannot unpack to more is not unpacked as a check."""


def refuse_damaged(path: Path) -> None:
    """Raise TrajectoryError if a file is not a binary FBX, is cut off, or states more data than it holds."""
    with path.open("rb") as file:
        head = file.read(FIRST_RECORD_BYTE)
        if head.startswith(MAGIC) and len(head) == FIRST_RECORD_BYTE:
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                _Records(path, content).walk()
            return
    if head and all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in head):
        raise TrajectoryError(path, "this is an FBX of text, or none", "export it as binary FBX, which Blender imports")
    raise TrajectoryError(path, "this is not an FBX file", "export it again")


class _Records:
    def __init__(self, path: Path, content: mmap.mmap) -> None:
        self.path, self.content = path, content
        (version,) = struct.unpack_from("<I", content, len(MAGIC))
        if version < MIN_FBX_VERSION:
            problem = f"this is FBX {version / 1000:.1f}, and Blender imports {MIN_FBX_VERSION / 1000:.1f} and later"
            raise TrajectoryError(path, problem, "export it as FBX 2011 or later")
        self.head = struct.Struct("<QQQB" if version >= SINCE_WIDE else "<IIIB")
        self.unpacked = 0

    def walk(self) -> None:
        place = FIRST_RECORD_BYTE
        ends: list[int] = []
        zeros = self.head.size
        try:
            while True:
                if ends and place == ends[-1] - zeros:
                    place = ends.pop()
                    continue
                end, count, _, name = self.head.unpack_from(self.content, place)
                if end == 0 and not ends:
                    return
                inside = ends[-1] - zeros if ends else len(self.content)
                begin = place + zeros + name
                if not begin <= end <= inside or count > end - begin:
                    self.fail("a part of it is longer than the whole")
                place = self._end_of_properties(begin, count)
                if place > end:
                    self.fail("a part of it is longer than the whole")
                if place < end:
                    ends.append(end)
                    if len(ends) > MAX_RECORD_DEPTH or end - place < zeros:
                        self.fail("its parts are not one in another")
        except struct.error:
            self.fail("it ends too soon")

    def _end_of_properties(self, place: int, count: int) -> int:
        for _ in range(count):
            kind = self.content[place : place + 1]
            place += 1
            if kind in BYTES_BY_TYPE:
                place += BYTES_BY_TYPE[kind]
            elif kind in (b"R", b"S"):
                (length,) = struct.unpack_from("<I", self.content, place)
                place += 4 + length
            elif kind in ITEM_BYTES_BY_TYPE:
                length, packed, size = struct.unpack_from("<III", self.content, place)
                place += 12
                self._refuse_false_size(place, length * ITEM_BYTES_BY_TYPE[kind], size, packed == 1)
                place += size
            else:
                self.fail("there are properties of no known kind" if kind else "it ends too soon")
        return place

    def _refuse_false_size(self, place: int, requested: int, size: int, packed: bool) -> None:
        """Refuse an array whose data do not fit the size in bytes (unpacked, if `packed`) that the file states."""
        self.unpacked += requested
        if self.unpacked > LARGEST_FILE:
            problem = f"its numbers are more than {LARGEST_FILE} bytes"
            raise TrajectoryError(self.path, problem, "export the skeleton without its meshes, or split the recording")
        if requested > size * MAX_EXPANSION_RATIO if packed else requested != size:
            self.fail("a list of numbers is not as long as it says")
        if not packed or size * MAX_EXPANSION_RATIO <= MAX_HARMLESS_BYTES:
            return
        try:
            made = len(zlib.decompressobj().decompress(self.content[place : place + size], requested + 1))
        except zlib.error:
            made = requested + 1
        if made > requested:
            self.fail("a list of numbers is not as long as it says")

    def fail(self, problem: str) -> NoReturn:
        raise TrajectoryError(self.path, f"this FBX is damaged ({problem})", "copy the file again, or export it again")
