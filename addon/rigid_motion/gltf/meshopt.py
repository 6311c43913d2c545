"""Documents that meshopt compressed, made readable: views of keys and vertices, not those of triangles.

Source: the specification of EXT_meshopt_compression, Khronos 2021, appendices A and B.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .accessors import ALIGNED, COMPRESSIONS
from .documents import Document, GltfError, Json, entry, objects, whole

VERSION = 0xA0
"""The first byte of what is read."""

BLOCK_BYTES, BLOCK_ELEMENTS, GROUP, TAIL = 8192, 256, 16, 32

BINDING = "inverseBindMatrices"

DENSEST = 64
"""Bytes that one of compressed ones is at most."""

MOST = 2**30
"""Bytes that all of a document may become."""

SHIFTS = {1: np.arange(6, -1, -2, dtype=np.uint8), 2: np.arange(4, -1, -4, dtype=np.uint8)}
"""Of the parts of a byte, the first one first, by how a group is packed."""


def decompressed(document: Document) -> Document:
    """Return a document with what of its views can be read in one more buffer; the same where meshopt is not in it.

    Views of meshes alone that are damaged, or compressed in a way that is not read, stay as they are.

    Raises
    ------
    GltfError
        For other views that are.
    """
    views = objects(document.json, "bufferViews")
    found = {number: own for number, view in enumerate(views) if (own := _compression(view))}
    if not found:
        return document
    json, data, room, of_meshes = copy.copy(document.json), bytearray(), MOST, _of_meshes(document.json)
    json["bufferViews"] = list(views)
    for number, own in found.items():
        try:
            content = _content(document, own, number, room)
        except GltfError:
            if number not in of_meshes:
                raise
            continue
        if content is None:
            continue
        room -= len(content)
        view = {"buffer": len(document.buffers), "byteOffset": len(data), "byteLength": len(content)}
        kept = {name: views[number][name] for name in ("byteStride", "name") if name in views[number]}
        json["bufferViews"][number] = view | kept
        data += content + bytes(-len(content) % ALIGNED)
    json["buffers"] = [*objects(json, "buffers"), {"byteLength": len(data)}]
    return replace(document, json=json, buffers=(*document.buffers, bytes(data)))


def _of_meshes(json: Json) -> set[int]:
    """Return the numbers of the views that have numbers of meshes, and none of animations or skins."""
    views = [accessor.get("bufferView") for accessor in objects(json, "accessors")]
    samplers = [sampler for animation in objects(json, "animations") for sampler in objects(animation, "samplers")]
    named = {sampler.get(name) for sampler in samplers for name in ("input", "output")}
    named |= {skin.get(BINDING) for skin in objects(json, "skins")}
    needed = {view for number, view in enumerate(views) if number in named}
    return {view for view in views if isinstance(view, int)} - needed


def _content(document: Document, own: Json, number: int, room: int) -> bytes | None:
    """Return the bytes of a view, room for so many of which is left; None for lists of triangles and normals."""
    width, restored = FILTERS.get(own.get("filter", "NONE"), (0, None))
    if own.get("mode") != "ATTRIBUTES" or restored is None:
        return None
    if whole(own, "count") * whole(own, "byteStride") > room:
        raise GltfError("what meshopt compressed is more than is read", "split the file")
    elements = _elements(document, own, number)
    if elements.shape[1] % width:
        raise GltfError(f"view {number} is compressed by meshopt, and damaged")
    return restored(elements)


def _compression(view: Json) -> Json | None:
    extensions = view.get("extensions")
    names = [name for name in COMPRESSIONS if isinstance(extensions, dict) and name in extensions]
    return view["extensions"][names[0]] if names else None


def _elements(document: Document, own: Json, number: int) -> np.ndarray:
    """Return the bytes of what is compressed, shape (count, stride)."""
    entry(document.json, "buffers", own.get("buffer"))
    source = document.buffers[own["buffer"]]
    first, length = whole(own, "byteOffset", 0), whole(own, "byteLength", least=1)
    count, stride = whole(own, "count", least=1), whole(own, "byteStride", least=1)
    if source is None or first + length > len(source) or count * stride > DENSEST * length or stride > BLOCK_ELEMENTS:
        raise GltfError(f"view {number} is compressed by meshopt, and says more than it holds")
    data = bytes(source[first : first + length])
    if data[0] != VERSION:
        raise GltfError(f"view {number} is compressed by a newer meshopt", "export the file without it")
    try:
        return _decoded(data, count, stride)
    except (IndexError, ValueError):
        raise GltfError(f"view {number} is compressed by meshopt, and damaged") from None


def _decoded(data: bytes, count: int, stride: int) -> np.ndarray:
    """Return elements (count, stride): of each byte the differences from element to element come block by block."""
    most = min(BLOCK_BYTES // stride // GROUP * GROUP, BLOCK_ELEMENTS)
    result, place = np.empty((count, stride), dtype=np.uint8), 1
    last = np.frombuffer(data, np.uint8, stride, len(data) - stride)
    for first in range(0, count, most):
        block = result[first : first + most]
        for column in range(stride):
            differences, place = _differences(data, place, len(block))
            signs = (differences >> 1) ^ (0 - (differences & 1))
            block[:, column] = last[column] + np.cumsum(signs, dtype=np.uint8)
        last = block[-1]
    if place + max(stride, TAIL) != len(data):
        raise ValueError
    return result


def _differences(data: bytes, place: int, count: int) -> tuple[np.ndarray, int]:
    """Return numbers (count,) that begin at a place, their lowest bit being the sign, and the place behind them."""
    groups = -(-count // GROUP)
    kinds, place = data[place : place + -(-groups // 4)], place + -(-groups // 4)
    result = np.zeros((groups, GROUP), dtype=np.uint8)
    for group, own in enumerate(result):
        kind = kinds[group // 4] >> (group % 4 * 2) & 3
        if kind == 3:
            own[:] = np.frombuffer(data, np.uint8, GROUP, place)
            place += GROUP
        elif kind:
            packed = np.frombuffer(data, np.uint8, 4 * kind, place)
            widest = 4**kind - 1
            own[:] = (packed[:, None] >> SHIFTS[kind] & widest).ravel()
            wide = own == widest
            more = int(np.count_nonzero(wide))
            own[wide] = np.frombuffer(data, np.uint8, more, place + 4 * kind) if more else 0
            place += 4 * kind + more
    return result.ravel()[:count], place


def _quaternions(elements: np.ndarray) -> bytes:
    """Three components of quaternions, and which is the fourth, as four."""
    given = np.ascontiguousarray(elements).view("<i2").reshape(-1, 4).astype(np.int64)
    parts = given[:, :3] / (given[:, 3:] | 3) * np.sqrt(0.5)
    fourth = np.sqrt(np.maximum(1.0 - np.sum(parts**2, axis=1), 0.0))
    largest = given[:, 3] & 3
    result = np.empty((len(given), 4))
    for offset, part in enumerate((fourth, *parts.T)):
        result[np.arange(len(given)), (largest + offset) % 4] = part
    return np.rint(result * 32767.0).astype("<i2").tobytes()


def _exponentials(elements: np.ndarray) -> bytes:
    """Whole numbers of 24 bits and their exponents as floats."""
    given = np.ascontiguousarray(elements).view("<i4")
    return np.ldexp((given << 8 >> 8).astype(np.float64), given >> 24).astype("<f4").tobytes()


FILTERS: dict[str, tuple[int, Callable[[np.ndarray], bytes]]]
FILTERS = {
    "NONE": (1, lambda elements: elements.tobytes()),
    "QUATERNION": (8, _quaternions),
    "EXPONENTIAL": (4, _exponentials),
}
"""What filters are undone by, and the bytes that it takes at once."""
