"""Pictures of a window: from the pixels of a virtual screen to a PNG that others can read."""

from __future__ import annotations

import struct

import bpy
import numpy as np
import pytest

from tests.gui.pictures import part_of, read_screen, write_png


@pytest.fixture
def pixels() -> np.ndarray:
    """A picture in which every pixel is another colour, wider than high."""
    return np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3) * 3


def dump(pixels: np.ndarray, *, order: str = "<", spare: int = 2, bits: int = 32) -> bytes:
    """An X Window Dump of these pixels: with a name, a table of two colours, and lines longer than the picture's."""
    height, width, _ = pixels.shape
    name = b"screen\0"
    red, green, blue = np.moveaxis(pixels.astype(np.uint32), -1, 0)
    lines = np.zeros((height, width + spare), order + "u4")
    lines[:, :width] = red << 16 | green << 8 | blue | 0xFF000000
    byte_order = 1 if order == ">" else 0
    fields = [100 + len(name), 7, 2, 24, width, height, 0, byte_order, 32, 0, 32, bits, 4 * (width + spare), 4]
    fields += [0xFF0000, 0x00FF00, 0x0000FF, 8, 256, 2, width, height, 0, 0, 0]
    return struct.pack(">25I", *fields) + name + bytes(2 * 12) + lines.tobytes()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("spare", [0, 2])
def test_the_pixels_of_a_screen_are_read_whatever_the_order_of_its_bytes(pixels, order, spare):
    np.testing.assert_array_equal(read_screen(dump(pixels, order=order, spare=spare)), pixels)


def test_a_screen_of_another_kind_is_refused(pixels):
    with pytest.raises(ValueError, match="24 bits"):
        read_screen(dump(pixels, bits=24))


def test_blender_reads_the_png_that_is_written(pixels, tmp_path, empty_file):
    write_png(tmp_path / "picture.png", pixels)
    image = bpy.data.images.load(str(tmp_path / "picture.png"))
    assert tuple(image.size) == (6, 4)
    seen = np.array(image.pixels).reshape(4, 6, 4)[::-1, :, :3]  # Blender's rows begin at the bottom
    np.testing.assert_array_equal(np.rint(seen * 255), pixels)
    assert [path.name for path in tmp_path.iterdir()] == ["picture.png"]


def test_a_box_is_counted_from_the_lower_left_corner(pixels):
    np.testing.assert_array_equal(part_of(pixels, (1, 0, 3, 2)), pixels[2:4, 1:4])
    np.testing.assert_array_equal(part_of(pixels, (0, 3, 6, 1)), pixels[:1])


def test_of_a_box_that_reaches_beyond_the_picture_there_is_what_the_picture_has(pixels):
    np.testing.assert_array_equal(part_of(pixels, (-2, -1, 4, 3)), pixels[2:4, :2])
    with pytest.raises(ValueError, match="outside of a picture of 6 x 4"):
        part_of(pixels, (6, 0, 3, 3))
    with pytest.raises(ValueError, match="outside"):
        part_of(pixels, (0, -9, 3, 3))
