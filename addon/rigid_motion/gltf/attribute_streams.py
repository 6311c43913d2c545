"""Meshopt attribute streams: encoding and decoding the differences between consecutive elements, byte by byte.

Elements are arrays of bytes, shape (count, stride). Differences are packed in groups of 16, with as few bits as a group
needs; larger differences follow as whole bytes. Version 0 is written, both versions are read.
Source: the specification of KHR_meshopt_compression, Khronos 2026, appendix A, mode 0.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

VERSION_BY_FIRST_BYTE = {0xA0: 0, 0xA1: 1}
"""Stream version by first byte."""

BLOCK_BYTES, BLOCK_ELEMENTS, GROUP_ELEMENTS = 8192, 256, 16

MIN_TAIL_BYTES = 32, 24
"""Least bytes of the tail of a stream, which includes the first element, by version."""

DIFFERENCE_BITS = (0, 2, 4, 8), (0, 1, 2, 4), (1, 2, 4, 8)
"""Bits of a difference, by the kind of its group: in version 0, then for each control mode of version 1."""

ZERO_CONTROL, LITERAL_CONTROL = 2, 3
"""Control modes without groups: all differences are 0, or all are whole bytes."""

MAX_GROUP_BYTES = 24
"""Most bytes of a group: 16 differences of 4 bits, all of them too large."""


def encoded(elements: np.ndarray) -> bytes:
    """Return the stream of elements (count, stride); the stride must be a multiple of 4, at most 256."""
    stride = elements.shape[1]
    tail = bytes(max(MIN_TAIL_BYTES[0] - stride, 0)) + elements[0].tobytes()
    return b"".join((b"\xa0", *map(_encoded_block, _blocks(elements)), tail))


def encoded_size(elements: np.ndarray) -> int:
    """Return the number of bytes of the stream of elements."""
    sizes = 0
    for block in _blocks(elements):
        groups, stride = block.shape[0], block.shape[1]
        sizes += stride * -(-groups // 4) + int(_group_sizes(block).min(axis=0).sum())
    return 1 + sizes + max(MIN_TAIL_BYTES[0], elements.shape[1])


def likely_size(elements: np.ndarray) -> float:
    """Return about how many bytes the elements take in a stream with many other elements."""
    result, stride = 0.0, elements.shape[1]
    for block in _blocks(elements):
        result += float(_group_sizes(block).min(axis=0).sum()) + stride * len(block) / 4
    return result * len(elements) / (-(-len(elements) // GROUP_ELEMENTS) * GROUP_ELEMENTS)


def differences(elements: np.ndarray) -> np.ndarray:
    """Return the difference of each byte from the element before, sign in the lowest bit, shape (count, stride).

    The first row is 0.
    """
    steps = np.diff(elements, axis=0, prepend=elements[:1])
    return (steps << 1) ^ (0 - (steps >> 7))


def _blocks(elements: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the differences of each block, shape (groups, stride, 16)."""
    count, stride = elements.shape
    most, every = _block_elements(stride), differences(elements)
    for first in range(0, count, most):
        block = every[first : first + most]
        block = np.pad(block, ((0, -len(block) % GROUP_ELEMENTS), (0, 0)))
        yield np.moveaxis(block.reshape(-1, GROUP_ELEMENTS, stride), 1, 2)


def _block_elements(stride: int) -> int:
    return min(BLOCK_BYTES // stride // GROUP_ELEMENTS * GROUP_ELEMENTS, BLOCK_ELEMENTS)


def _group_sizes(block: np.ndarray) -> np.ndarray:
    """Return the bytes of each group for each of the four kinds, shape (4, groups, stride)."""
    nothing = np.where(block.any(axis=-1), GROUP_ELEMENTS + 1, 0)
    packed = [2 * bits + np.count_nonzero(block >= 2**bits - 1, axis=-1) for bits in DIFFERENCE_BITS[0][1:3]]
    return np.stack((nothing, *packed, np.full(nothing.shape, GROUP_ELEMENTS)))


def _encoded_block(block: np.ndarray) -> bytes:
    groups, stride, _ = block.shape
    kinds = _group_sizes(block).argmin(axis=0)
    four = np.pad(kinds, ((0, -groups % 4), (0, 0))).reshape(-1, 4, stride).astype(np.uint8)
    headers = (four << np.array([0, 2, 4, 6], dtype=np.uint8)[:, None]).sum(axis=1, dtype=np.uint8)
    content = np.zeros((groups, stride, MAX_GROUP_BYTES), dtype=np.uint8)
    used = np.zeros(content.shape, dtype=bool)
    for kind in (1, 2):
        some = kinds == kind
        bits, differences = DIFFERENCE_BITS[0][kind], block[some]
        widest, each = 2**bits - 1, 8 // bits
        parts = np.minimum(differences, widest).reshape(len(differences), GROUP_ELEMENTS // each, each)
        shifts = bits * np.arange(each - 1, -1, -1, dtype=np.uint8)
        packed = (parts << shifts).sum(axis=-1, dtype=np.uint8)
        wide = differences >= widest
        order = np.argsort(~wide, axis=1, kind="stable")
        rest = np.take_along_axis(differences, order, axis=1)
        content[some] = np.pad(np.hstack((packed, rest)), ((0, 0), (0, MAX_GROUP_BYTES)))[:, :MAX_GROUP_BYTES]
        used[some] = np.arange(MAX_GROUP_BYTES) < (packed.shape[1] + np.count_nonzero(wide, axis=1))[:, None]
    content[kinds == 3, :GROUP_ELEMENTS], used[kinds == 3, :GROUP_ELEMENTS] = block[kinds == 3], True
    whole = np.hstack((headers.T, np.swapaxes(content, 0, 1).reshape(stride, -1)))
    is_used = np.hstack((np.ones(headers.T.shape, dtype=bool), np.swapaxes(used, 0, 1).reshape(stride, -1)))
    return whole[is_used].tobytes()


def decoded(data: bytes, count: int, stride: int) -> np.ndarray:
    """Return the elements of a stream, shape (count, stride).

    Raises
    ------
    IndexError, KeyError, ValueError
        If the data is no stream of that many elements.
    """
    version = VERSION_BY_FIRST_BYTE[data[0]]
    result, place = np.empty((count, stride), dtype=np.uint8), 1
    tail = stride + version * stride // 4
    modes = data[len(data) - stride // 4 :] if version else bytes(stride // 4)
    last = np.frombuffer(data, np.uint8, stride, len(data) - tail)
    for first in range(0, count, _block_elements(stride)):
        block = result[first : first + _block_elements(stride)]
        controls, place = data[place : place + version * stride // 4], place + version * stride // 4
        for column in range(stride):
            control = controls[column // 4] >> column % 4 * 2 & 3 if version else 0
            block[:, column], place = _decoded_column(data, place, len(block), control, version)
        for channel, mode in enumerate(modes):
            own = slice(4 * channel, 4 * channel + 4)
            block[:, own] = _summed(block[:, own], last[own], mode)
        last = block[-1]
    if place + max(tail, MIN_TAIL_BYTES[version]) != len(data):
        raise ValueError
    return result


def _decoded_column(data: bytes, place: int, count: int, control: int, version: int) -> tuple[np.ndarray, int]:
    """Return the differences (count,) that begin at a place in the data, and the place after them."""
    if control == ZERO_CONTROL:
        return np.zeros(count, dtype=np.uint8), place
    if control == LITERAL_CONTROL:
        return np.frombuffer(data, np.uint8, count, place), place + count
    groups = -(-count // GROUP_ELEMENTS)
    kinds, place = data[place : place + -(-groups // 4)], place + -(-groups // 4)
    result = np.zeros((groups, GROUP_ELEMENTS), dtype=np.uint8)
    for group, own in enumerate(result):
        bits = DIFFERENCE_BITS[version + control][kinds[group // 4] >> group % 4 * 2 & 3]
        if bits == 8:
            own[:] = np.frombuffer(data, np.uint8, GROUP_ELEMENTS, place)
            place += GROUP_ELEMENTS
        elif bits:
            packed = np.frombuffer(data, np.uint8, 2 * bits, place)
            own[:] = (packed[:, None] >> PART_SHIFTS[bits] & 2**bits - 1).ravel()
            wide = own == 2**bits - 1
            more = int(np.count_nonzero(wide))
            own[wide] = np.frombuffer(data, np.uint8, more, place + 2 * bits) if more else 0
            place += 2 * bits + more
    return result.ravel()[:count], place


PART_SHIFTS = {1: np.arange(8, dtype=np.uint8)} | {
    bits: np.arange(8 - bits, -1, -bits, dtype=np.uint8) for bits in DIFFERENCE_BITS[0][1:3]
}
"""Bit shifts of the parts of a byte, first part first, by the bits of a part."""


def _summed(steps: np.ndarray, last: np.ndarray, mode: int) -> np.ndarray:
    """Return the bytes (n, 4) that result from adding steps (n, 4) to the last element before them."""
    if mode & 15 > 2 or (mode & 15 < 2 and mode > 1):
        raise ValueError
    kind = np.dtype(("<u1", "<u2", "<u4")[mode & 15])
    before, own = (np.ascontiguousarray(some).view(kind) for some in (last, steps))
    if mode & 15 < 2:
        signed = (own >> 1) ^ (0 - (own & 1)).astype(kind)
        return (before + np.cumsum(signed, axis=0, dtype=kind)).astype(kind).view(np.uint8)
    turn = mode >> 4
    turned = own << turn | own >> (32 - turn) % 32
    return (before ^ np.bitwise_xor.accumulate(turned, axis=0)).view(np.uint8)
