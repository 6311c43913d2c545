"""Pictures of a Blender window: read from a virtual screen's dump, written as PNG.

Pixels are (height, width, 3) arrays of red, green, blue from 0 to 255, the top row first. The module needs NumPy alone,
to run in Blender's Python as well as in that of the tests. Formats: X Window Dump version 7 (X11/XWDFile.h), PNG (RFC
2083).
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

COLOUR_BYTES = 12
"""Bytes per entry of an X Window Dump's colour table, which lies between header and pixels."""


def read_screen(dump: bytes) -> np.ndarray:
    """Return the pixels of an X Window Dump with true colours, 32 bits per pixel, as virtual screens write it.

    Raises
    ------
    ValueError
        For any other dump.
    """
    fields = struct.unpack_from(">25I", dump)
    header_size, version, pixmap_format, _, width, height, _, byte_order = fields[:8]
    bits_per_pixel, bytes_per_line, masks, colours = fields[11], fields[12], fields[14:17], fields[19]
    if (version, pixmap_format, bits_per_pixel) != (7, 2, 32):
        kind = f"version {version}, format {pixmap_format}, {bits_per_pixel} bits a pixel"
        raise ValueError(f"a screen dump of {kind}; only version 7, format 2, 32 bits a pixel is read")
    start = header_size + colours * COLOUR_BYTES
    lines = np.frombuffer(dump, ">u4" if byte_order else "<u4", height * bytes_per_line // 4, start)
    pixels = lines.reshape(height, bytes_per_line // 4)[:, :width]
    shifts = [mask.bit_length() - 8 for mask in masks]
    return np.stack([(pixels >> shift) & 0xFF for shift in shifts], axis=-1).astype(np.uint8)


def part_of(pixels: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """Return the pixels in a box: x and y of its lower left corner, width and height, as for Blender's areas.

    Raises
    ------
    ValueError
        If no part of the picture is in the box.
    """
    x, y, width, height = box
    top = len(pixels) - y - height
    part = pixels[max(top, 0) : max(top + height, 0), max(x, 0) : max(x + width, 0)]
    if not part.size:
        raise ValueError(f"the box {box} is outside of a picture of {pixels.shape[1]} x {pixels.shape[0]}")
    return part


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write pixels as a PNG file, completely or not at all."""
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + width * 3), np.uint8)  # each row begins with its filter type, 0 for none
    rows[:, 1:] = pixels.reshape(height, width * 3)
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b"")]
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    beside = path.with_name(f".{path.name}")
    beside.write_bytes(png)
    beside.replace(path)
