"""Decoder for meshopt index streams: corners of triangles, and other indices. There is no encoder.

Source: the specification of KHR_meshopt_compression, Khronos 2026, appendix A, modes 1 and 2.
"""

from __future__ import annotations

import numpy as np

TRIANGLE_BYTE, INDEX_BYTE = 0xE1, 0xD1
"""First byte of a stream, for triangles and for other indices."""

CODE_TABLE_BYTES, PADDING_BYTES = 16, 4
"""Bytes at the end of a stream, for triangles and for other indices."""

FULL_CODE, MASK_32 = 15, 0xFFFFFFFF

RECENT_EDGES = 16
"""Number of recent edges, and of recent corners, that a triangle may refer to."""


class _Numbers:
    """Reader of numbers stored in 7 bits per byte."""

    def __init__(self, data: bytes, place: int, end: int) -> None:
        self.data, self.place, self.end = data, place, end

    def byte(self) -> int:
        if self.place >= self.end:
            raise ValueError
        self.place += 1
        return self.data[self.place - 1]

    def number(self) -> int:
        result = 0
        for shift in range(0, 35, 7):
            part = self.byte()
            result |= (part & 127) << shift
            if part < 128:
                return result & MASK_32
        raise ValueError


def decoded_indices(data: bytes, count: int, stride: int) -> np.ndarray:
    """Return the bytes of indices, shape (count, stride).

    Raises
    ------
    IndexError, ValueError
        If the data is no stream of that many indices.
    """
    numbers, last, result = _Numbers(data, 1, len(data) - PADDING_BYTES), [0, 0], np.empty(count, dtype=np.uint32)
    if data[0] != INDEX_BYTE:
        raise ValueError
    for place in range(count):
        number = numbers.number()
        step = ~(number >> 2) if number & 2 else number >> 2
        result[place] = last[number & 1] = last[number & 1] + step & MASK_32
    return _as_bytes(result, stride, numbers)


def decoded_triangles(data: bytes, count: int, stride: int) -> np.ndarray:
    """Return the bytes of the corners of triangles, shape (count, stride).

    Raises
    ------
    IndexError, ValueError
        If the data is no stream of that many corners.
    """
    end = len(data) - CODE_TABLE_BYTES
    codes, table = data[1 : 1 + count // 3], data[end:]
    numbers = _Numbers(data, 1 + count // 3, end)
    if data[0] != TRIANGLE_BYTE or count % 3 or len(codes) != count // 3 or numbers.place > end or any(table[-2:]):
        raise ValueError
    following = last = 0
    edges: list[tuple[int, int]] = []
    corners: list[int] = []
    result: list[int] = []

    def fresh() -> int:
        nonlocal following
        following = following + 1 & MASK_32
        return following - 1 & MASK_32

    def explicit() -> int:
        nonlocal last
        number = numbers.number()
        last = last + (~(number >> 1) if number & 1 else number >> 1) & MASK_32
        return last

    def corner(part: int) -> tuple[int, bool]:
        """Return the corner for a half-byte code, and whether it was not recent."""
        if part == FULL_CODE:
            return explicit(), True
        return (corners[-part], False) if part else (fresh(), True)

    for code in codes:
        high, low = code >> 4, code & 15
        if high < FULL_CODE:
            a, b = edges[-1 - high]
            if 0 < low < 13:
                c = corners[-1 - low]
            else:
                c = fresh() if not low else explicit() if low == FULL_CODE else last + (-1, 1)[low - 13] & MASK_32
                last = c if low in (13, 14) else last
                corners.append(c)
            edges += [(c, b), (a, c)]
        else:
            parts = table[low] if low < 14 else numbers.byte()
            if low >= 14 and not parts:
                following = 0
            a = explicit() if low == FULL_CODE else fresh()
            (b, has_b), (c, has_c) = corner(parts >> 4), corner(parts & 15)
            edges += [(b, a), (c, b), (a, c)]
            corners += [a, *([b] if has_b else []), *([c] if has_c else [])]
        result += [a, b, c]
        del edges[:-RECENT_EDGES], corners[:-RECENT_EDGES]
    return _as_bytes(np.array(result, dtype=np.uint32), stride, numbers)


def _as_bytes(indices: np.ndarray, stride: int, numbers: _Numbers) -> np.ndarray:
    if numbers.place != numbers.end:
        raise ValueError
    return indices.astype(f"<u{stride}").view(np.uint8).reshape(-1, stride)
