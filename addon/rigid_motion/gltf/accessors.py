"""glTF accessors: decoding numbers from the buffer views of a document, and adding new accessors.

Rows are elements, columns are components: shape (count, components). Normalised integers become floats from -1 to 1, or
from 0 to 1 (glTF 2.0 specification, sections 3.6 and 3.11).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .documents import Document, GltfError, Json, bytes_of, entry, shown, whole

NUMBER_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy types by glTF component type."""

COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

MOST_ZEROS = 2**22
"""Limit on how far an accessor's numbers may exceed the bytes of the file: an accessor without a view is all zeros."""

COMPRESSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
"""Extensions that compress the bytes of a view, so accessors cannot read them directly."""

ALL_ROWS = slice(None)

TYPE_BY_COUNT = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

COMPONENT_TYPES = {kind.lstrip("<"): number for number, kind in NUMBER_TYPES.items()}

ALIGNMENT_BYTES = 4
"""Bytes to which numbers are aligned."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The numbers of an accessor, read from the file when sliced: like an array of shape (n, *shape), float64."""

    document: Document
    number: int
    count: int
    """Number of rows; a row may combine several elements."""

    shape: tuple[int, ...]
    order: list[int] | slice
    """Order of the columns."""

    @property
    def size(self) -> int:
        """The number of values."""
        return self.count * math.prod(self.shape)

    def __getitem__(self, rows: slice) -> np.ndarray:
        first, end, _ = rows.indices(self.count)
        each = whole(entry(self.document.json, "accessors", self.number), "count") // self.count
        result = numbers(self.document, self.number, slice(first * each, end * each))
        return result.reshape(end - first, *self.shape)[..., self.order]


def raw_numbers(document: Document, number: object, rows: slice = ALL_ROWS) -> np.ndarray:
    """Return the stored numbers of an accessor, or of some of its elements, shape (count, components).

    Raises
    ------
    GltfError
        If the accessor does not fit its buffer, or is compressed.
    """
    accessor = entry(document.json, "accessors", number)
    kind, columns, count = _number_type(accessor), _column_count(accessor), whole(accessor, "count", least=1)
    if count * columns > MOST_ZEROS + bytes_of(document):
        raise GltfError(f"accessor {number} has {count} elements, more than are read")
    if "bufferView" in accessor:
        result = _in_view(document, accessor, kind, columns, count, f"accessor {number}", rows)
    else:
        result = np.zeros((len(range(*rows.indices(count))), columns), kind)
    return _with_sparse(document, accessor, result, f"accessor {number}", rows) if "sparse" in accessor else result


def numbers(document: Document, number: object, rows: slice = ALL_ROWS) -> np.ndarray:
    """Return the numbers of an accessor, or of some of its elements, shape (count, components), float64.

    Raises
    ------
    GltfError
        As `raw_numbers`, and for numbers that are not finite.
    """
    raw = raw_numbers(document, number, rows)
    if not np.isfinite(raw).all():
        raise GltfError(f"accessor {number} has numbers that are not finite")
    normalised = entry(document.json, "accessors", number).get("normalized") is True
    return denormalised(raw) if normalised and raw.dtype.kind != "f" else raw.astype(np.float64)


def denormalised(raw: np.ndarray) -> np.ndarray:
    """Return the floats that normalised integers represent."""
    return np.maximum(raw / np.iinfo(raw.dtype).max, -1.0)


def parts_of(json: Json, number: int) -> Iterator[tuple[Json, int, int]]:
    """Yield each part of an accessor that names a view, with its byte range in the view: first byte and end."""
    for part, width, count in _parts(json, number):
        first = whole(part, "byteOffset", 0)
        stride = whole(entry(json, "bufferViews", part["bufferView"]), "byteStride", width)
        yield part, first, first + max((count - 1) * stride + width, 0)


def stored_size(json: Json, number: int) -> int:
    """Return the bytes that the numbers of an accessor take, without gaps between them."""
    return sum(width * count for _, width, count in _parts(json, number))


def _parts(json: Json, number: int) -> Iterator[tuple[Json, int, int]]:
    """Yield each part of an accessor that names a view, its bytes per element and its number of elements."""
    accessor = entry(json, "accessors", number)
    size, columns = _number_type(accessor).itemsize, _column_count(accessor)
    if accessor["type"].startswith("MAT"):  # Each column of a matrix begins aligned.
        rows = math.isqrt(columns)
        width = rows * -(-rows * size // ALIGNMENT_BYTES) * ALIGNMENT_BYTES
    else:
        width = size * columns
    if "bufferView" in accessor:
        yield accessor, width, whole(accessor, "count")
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        yield sparse["indices"], _number_type(sparse["indices"]).itemsize, whole(sparse, "count")
        yield sparse["values"], width, whole(sparse, "count")


def _number_type(accessor: Json) -> np.dtype:
    kind = accessor.get("componentType")
    if not isinstance(kind, int) or kind not in NUMBER_TYPES:
        raise GltfError(f"an accessor has components of the type {shown(kind)}, which glTF does not know")
    return np.dtype(NUMBER_TYPES[kind])


def _column_count(accessor: Json) -> int:
    kind = accessor.get("type")
    if not isinstance(kind, str) or kind not in COMPONENT_COUNTS:
        raise GltfError(f"an accessor is of the type {shown(kind)}, which glTF does not know")
    return COMPONENT_COUNTS[kind]


def _in_view(
    document: Document, part: Json, kind: np.dtype, columns: int, count: int, what: str, rows: slice = ALL_ROWS
) -> np.ndarray:
    """Return elements of a part of the document that names a view and an offset; `rows` selects some of them."""
    view = entry(document.json, "bufferViews", part.get("bufferView"))
    extensions = view.get("extensions")
    if isinstance(extensions, dict) and any(name in extensions for name in COMPRESSIONS):
        raise GltfError(
            f"{what} is compressed by meshopt, and damaged", "export the file without it (gltfpack: without -c)"
        )
    entry(document.json, "buffers", view.get("buffer"))
    data = document.buffers[view["buffer"]]
    if data is None:
        raise GltfError(f"{what} is in a buffer that has no bytes")
    first, length = whole(view, "byteOffset", 0), whole(view, "byteLength", least=1)
    width = kind.itemsize * columns
    stride, offset = whole(view, "byteStride", width, least=1), whole(part, "byteOffset", 0)
    if first + length > len(data) or offset + (count - 1) * stride + width > length or stride < width:
        raise GltfError(f"{what} reaches beyond the bytes that it names")
    some = range(*rows.indices(count))
    begin = first + offset + some.start * stride
    content = bytes(data[begin : begin + max(len(some) - 1, 0) * stride + width])
    return np.ndarray((len(some), columns), kind, content, 0, (stride, kind.itemsize))


def _with_sparse(document: Document, accessor: Json, result: np.ndarray, what: str, rows: slice) -> np.ndarray:
    """Return the selected elements with the values of a sparse accessor filled in."""
    sparse = accessor["sparse"]
    if not all(isinstance(part, dict) for part in (sparse, sparse.get("indices"), sparse.get("values"))):
        raise GltfError(f"{what} is sparse, and does not say what is where")
    count, kind = whole(sparse, "count", least=1), _number_type(sparse["indices"])
    indices = _in_view(document, sparse["indices"], kind, 1, count, what)[:, 0].astype(np.int64)
    values = _in_view(document, sparse["values"], result.dtype, result.shape[1], count, what)
    if kind.kind != "u" or np.max(indices) >= whole(accessor, "count") or np.any(np.diff(indices) <= 0):
        raise GltfError(f"{what} is sparse, and its indices do not rise to its last element")
    first, end, _ = rows.indices(whole(accessor, "count"))
    here = (indices >= first) & (indices < end)
    result = result.copy()
    result[indices[here] - first] = values[here]
    return result


class GrowingView:
    """A new last buffer view of a document, with the bytes that will go into a buffer.

    The view and its accessors are added to the lists of the document.
    """

    def __init__(self, json: Json) -> None:
        self.accessors, views = (json.setdefault(name, []) for name in ("accessors", "bufferViews"))
        self.number = len(views)
        self.json: Json = {"buffer": 0}
        views.append(self.json)
        self.data = bytearray()
        self._known: dict[tuple[str, int, bytes], int] = {}

    def add(self, numbers: np.ndarray, *, bounds: bool = False) -> int:
        """Return the number of an accessor for these numbers (count, columns), reusing an equal accessor.

        Signed integers are marked as normalised.
        """
        kind, content = numbers.dtype.str.lstrip("<|"), numbers.tobytes()
        known = (kind, numbers.shape[1], content)
        if known not in self._known:
            accessor = self.placed(content) | {"componentType": COMPONENT_TYPES[kind]}
            accessor |= {"normalized": True} if numbers.dtype.kind == "i" else {}
            accessor |= {"count": len(numbers), "type": TYPE_BY_COUNT[numbers.shape[1]]}
            self._known[known] = len(self.accessors)
            self.accessors.append(accessor)
        if bounds:
            ends = {"min": numbers.min(axis=0), "max": numbers.max(axis=0)}
            self.accessors[self._known[known]] |= {name: [float(str(x)) for x in end] for name, end in ends.items()}
        return self._known[known]

    def placed(self, content: bytes) -> Json:
        """Append these bytes, and return the members of an accessor that say where they are."""
        self.data += bytes(-len(self.data) % ALIGNMENT_BYTES)
        offset = len(self.data)
        self.data += content
        return {"bufferView": self.number} | ({"byteOffset": offset} if offset else {})
