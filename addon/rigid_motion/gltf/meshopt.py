"""Meshopt compression of glTF documents: decompressing and compressing without loss, bit by bit.

Reads all modes and filters of both names of the extension. Writes attributes, with the filters for quaternions and
floats where these restore the same numbers; streams of the original document are kept.
Source: the specifications of EXT_meshopt_compression, Khronos 2021, and KHR_meshopt_compression, Khronos 2026.
"""

from __future__ import annotations

import copy
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from .accessors import ALIGNMENT_BYTES, COMPRESSIONS, raw_numbers, stored_size
from .attribute_streams import MIN_TAIL_BYTES, VERSION_BY_FIRST_BYTE, decoded, differences, encoded, encoded_size
from .documents import Document, GltfError, Json, as_text, data_uri, entry, objects, whole
from .filters import (
    EXPONENTIAL,
    FEWEST_BITS,
    MAX_INT16,
    MOST_BITS,
    QUATERNION,
    UNDO_BY_FILTER,
    floats_of,
    quaternions_of,
    with_floats,
    with_quaternions,
)
from .index_streams import decoded_indices, decoded_triangles
from .references import References, other_slots, sampler_slots, view_slots

INVERSE_BINDS = "inverseBindMatrices"

MAX_ELEMENT_BYTES = 256
"""Most bytes of an element."""

MAX_EXPANSION_RATIO = 1024
"""Most bytes that one compressed byte may expand to."""

MAX_DOCUMENT_BYTES = 2**30
"""Most bytes of a document after decompression."""

NO_FILTER, ATTRIBUTES_MODE = "NONE", "ATTRIBUTES"

MODES = {"TRIANGLES": decoded_triangles, "INDICES": decoded_indices}

TRANSFORMS = ("translation", "rotation", "scale", "matrix")
"""Transform members of a node."""

STREAM_OVERHEAD_BYTES = 1 + MIN_TAIL_BYTES[0]
"""Bytes of a stream besides its elements, except for large elements."""

LEAST_EXPONENT = -100

TIME_EXPONENT = -15
"""Times are multiples of 2 to this power, if they can be."""

SINGLE_BITS = 24
"""Bits of the mantissa of a float."""


@dataclass(frozen=True, eq=False)
class Streams:
    """The streams of the original document."""

    name: str = COMPRESSIONS[0]
    """Name of the extension."""

    known: dict[bytes, tuple[str, Json, bytes]] = field(default_factory=dict)
    """By the bytes of a view: the name of the extension, its content, and the stream."""

    shares: dict[int, float] = field(default_factory=dict)
    """Bytes of the stream as a fraction of the view's bytes, by view number."""


def decompressed(document: Document) -> Document:
    """Return a document with all meshopt views decompressed into an additional buffer; unchanged if there are none.

    Damaged views that only meshes use stay unchanged.

    Raises
    ------
    GltfError
        If another view is damaged.
    """
    return unpacked(document)[0]


def unpacked(document: Document) -> tuple[Document, Streams]:
    """Return the same as `decompressed`, and the streams of the document."""
    views = objects(document.json, "bufferViews")
    found = {number: how for number, view in enumerate(views) if (how := _compression(view))}
    if not found:
        return document, Streams()
    json, data, room, of_meshes = copy.copy(document.json), bytearray(), MAX_DOCUMENT_BYTES, _mesh_views(document.json)
    streams = Streams(max(name for name, _ in found.values()))
    json["bufferViews"] = list(views)
    for number, (name, own) in found.items():
        try:
            stream = _stream(document, own, room)
            content = _content(own, stream)
        except GltfError as error:
            if number in of_meshes:
                continue
            raise GltfError(f"view {number} is compressed by meshopt: {error.problem}", error.way_out) from None
        room -= len(content)
        view = {"buffer": len(document.buffers), "byteOffset": len(data), "byteLength": len(content)}
        json["bufferViews"][number] = view | {
            key: value for key, value in views[number].items() if key not in (*view, "extensions")
        }
        streams.known[content] = name, own, stream
        streams.shares[number] = len(stream) / len(content)
        data += content + bytes(-len(content) % ALIGNMENT_BYTES)
    json["buffers"] = [*objects(json, "buffers"), {"byteLength": len(data)}]
    return replace(document, json=json, buffers=(*document.buffers, bytes(data))), streams


def _mesh_views(json: Json) -> set[int]:
    """Return the numbers of the views whose accessors belong to meshes, none to animations or skins."""
    views = [accessor.get("bufferView") for accessor in objects(json, "accessors")]
    samplers = [sampler for animation in objects(json, "animations") for sampler in objects(animation, "samplers")]
    named = {sampler.get(name) for sampler in samplers for name in ("input", "output")}
    named |= {skin.get(INVERSE_BINDS) for skin in objects(json, "skins")}
    needed = {view for number, view in enumerate(views) if number in named}
    return {view for view in views if isinstance(view, int)} - needed


def _compression(view: Json) -> tuple[str, Json] | None:
    """Return the name and content of the extension that compresses a view."""
    extensions = view.get("extensions")
    names = [name for name in COMPRESSIONS if isinstance(extensions, dict) and name in extensions]
    return (names[0], view["extensions"][names[0]]) if names else None


def _stream(document: Document, own: Json, room: int) -> bytes:
    """Return the compressed bytes of a view, after checking that its decompressed size fits into `room`."""
    if not isinstance(own, dict):
        raise GltfError("it does not say how")
    size = whole(own, "count", least=1) * whole(own, "byteStride", least=1)
    if size > room:
        raise GltfError("what meshopt compressed is more than is read", "split the file")
    entry(document.json, "buffers", own.get("buffer"))
    source = document.buffers[own["buffer"]]
    first, length = whole(own, "byteOffset", 0), whole(own, "byteLength", least=1)
    if source is None or first + length > len(source) or size > MAX_EXPANSION_RATIO * length:
        raise GltfError("it says more than it holds")
    return bytes(source[first : first + length])


def _content(own: Json, stream: bytes) -> bytes:
    """Return the bytes of a view, decoded from its stream."""
    mode, name = own.get("mode"), own.get("filter", NO_FILTER)
    count, stride = whole(own, "count"), whole(own, "byteStride")
    strides, undone = UNDO_BY_FILTER.get(name, ((), None)) if isinstance(name, str) else ((), None)
    fits = stride % 4 == 0 and stride <= MAX_ELEMENT_BYTES and stride in (strides or (stride,))
    if mode in MODES:
        fits = stride in (2, 4) and name == NO_FILTER
    elif mode != ATTRIBUTES_MODE or undone is None:
        raise GltfError("its mode or filter is not known", "export the file without meshopt")
    if mode == ATTRIBUTES_MODE and stream[0] not in VERSION_BY_FIRST_BYTE:
        raise GltfError("it is newer than is known here", "export the file without it")
    try:
        if not fits:
            raise ValueError
        elements = (decoded if mode == ATTRIBUTES_MODE else MODES[mode])(stream, count, stride)
        with np.errstate(all="ignore"):
            return undone(elements).tobytes() if undone else b""
    except (ArithmeticError, IndexError, ValueError):
        raise GltfError("it is damaged") from None


class Packed(NamedTuple):
    """Numbers as elements for a filter, which restores them."""

    filter: str
    elements: np.ndarray
    """Bytes, shape (count, stride)."""


def filtered(numbers: np.ndarray, most: int = 0) -> Packed | None:
    """Return numbers (count, columns) as elements that take few bytes; None if they cannot be packed.

    Floats are stored as multiples of 2 to the power of `most`, or of a smaller power.
    """
    numbers = np.ascontiguousarray(numbers)
    plain = Packed(NO_FILTER, numbers.view(np.uint8))
    if numbers.dtype == np.int16 and numbers.shape[1] == 4:
        for bits in range(FEWEST_BITS, MOST_BITS + 1):
            first, second = (with_quaternions(numbers / MAX_INT16, bits, rank) for rank in (0, 1))
            fits = (quaternions_of(first) == numbers).all(axis=1)
            elements = np.where(fits[:, None], first, second)
            if np.array_equal(quaternions_of(elements), numbers):
                return Packed(QUATERNION, elements)
    if numbers.dtype == np.float32:
        exponent = min(_exponent(numbers), most)
        elements = with_floats(numbers.astype(np.float64), exponent)
        if floats_of(elements).tobytes() == numbers.tobytes():
            return Packed(EXPONENTIAL, elements)
    return plain if plain.elements.shape[1] % 4 == 0 else None


def _exponent(numbers: np.ndarray) -> int:
    """Return the exponent of the largest power of 2 that all floats are multiples of."""
    mantissas, exponents = np.frexp(numbers[numbers != 0.0].astype(np.float64))
    integers = np.ldexp(mantissas, SINGLE_BITS).astype(np.int64)
    lowest = np.frexp((integers & -integers).astype(np.float64))[1] - 1
    return max(int((exponents - SINGLE_BITS + lowest).min(initial=0)), LEAST_EXPONENT)


class Group(NamedTuple):
    """Accessors that share a view."""

    filter: str
    numbers: list[int]
    """Numbers of the accessors, in their order in the view."""

    elements: np.ndarray
    """Shape (count, stride)."""


def grouped(arrays: Mapping[int, np.ndarray], times: Iterable[int]) -> list[Group]:
    """Return accessor numbers in groups that share a filter and a stride; times get groups of their own.

    Arrays have shape (count, columns). Accessors that cannot be packed are left out.
    """
    times = set(times)
    groups: dict[tuple[bool, str, int], dict[int, np.ndarray]] = defaultdict(dict)
    for number, array in arrays.items():
        if (own := filtered(array, TIME_EXPONENT if number in times else 0)) is not None:
            groups[number in times, own.filter, own.elements.shape[1]][number] = own.elements
    result = []
    for (_, name, _), members in groups.items():
        orders = [list(members), *([_chained(members)] if len(members) > 2 else [])]
        joined = [np.concatenate([members[number] for number in order]) for order in orders]
        best = min(range(len(orders)), key=lambda way: encoded_size(joined[way]))
        result.append(Group(name, orders[best], joined[best]))
    return result


def _chained(members: Mapping[int, np.ndarray]) -> list[int]:
    """Return the numbers in an order in which each array begins close to the end of the one before."""
    numbers = np.array(list(members))
    firsts, lasts = (np.stack([elements[end] for elements in members.values()]) for end in (0, -1))
    waiting = np.ones(len(numbers), dtype=bool)
    order, place = [], int(np.argmax([len(elements) for elements in members.values()]))
    while True:
        order.append(int(numbers[place]))
        waiting[place] = False
        left = np.flatnonzero(waiting)
        if not len(left):
            return order
        pairs = np.stack((np.broadcast_to(lasts[place], firsts[left].shape), firsts[left]))
        steps = differences(pairs.reshape(2, -1))[1].reshape(len(left), -1)
        place = int(left[np.digitize(steps, (1, 3, 15)).sum(axis=1).argmin()])


def packed_size(arrays: Sequence[np.ndarray], times: Iterable[int]) -> int:
    """Return the bytes that arrays (count, columns) take in streams shared with others; `times` numbers the times."""
    times = set(times)
    unique = {(n in times, array.dtype.str, array.shape, array.tobytes()): n for n, array in enumerate(arrays)}
    return sum(
        encoded_size(it.elements) - STREAM_OVERHEAD_BYTES
        for it in grouped({n: arrays[n] for n in unique.values()}, times)
    )


class _Buffers:
    """Buffers of a document under construction: one with bytes, and a placeholder for each compression extension."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.sizes: dict[str, int] = {}
        self.views: list[Json] = []

    def put(self, content: bytes) -> Json:
        self.data += bytes(-len(self.data) % ALIGNMENT_BYTES)
        place = {"buffer": 0, "byteLength": len(content)} | ({"byteOffset": len(self.data)} if self.data else {})
        self.data += content
        return place

    def add(self, view: Json, content: bytes) -> int:
        """Add a view of uncompressed bytes, and return its number."""
        self.views.append(_without_place(view) | self.put(content))
        return len(self.views) - 1

    def add_stream(self, view: Json, name: str, own: Json, stream: bytes) -> int:
        """Add a view that is compressed to a stream, and return its number."""
        size, offset = (
            own["count"] * own["byteStride"],
            -(-self.sizes.get(name, 0) // ALIGNMENT_BYTES) * ALIGNMENT_BYTES,
        )
        number = 1 + list(self.sizes | {name: 0}).index(name)
        self.sizes[name] = offset + size
        place = {"buffer": number, "byteLength": size} | ({"byteOffset": offset} if offset else {})
        kept = {key: value for key, value in own.items() if key not in ("buffer", "byteOffset", "byteLength")}
        self.views.append(_without_place(view) | place | {"extensions": {name: self.put(stream) | kept}})
        return len(self.views) - 1


def _without_place(view: Json) -> Json:
    return {key: value for key, value in view.items() if key not in ("buffer", "byteOffset", "byteLength")}


def _extension_content(name: str, elements: np.ndarray) -> Json:
    """Return the content of the extension for compressed elements."""
    count, stride = elements.shape
    own = {"count": count, "byteStride": stride, "mode": ATTRIBUTES_MODE}
    return own if name == NO_FILTER else own | {"filter": name}


def packed(document: Document, streams: Streams) -> Document:
    """Return an uncompressed document with its numbers compressed, in one buffer; see `are_clear` for the condition."""
    json, buffers, numbers = copy.deepcopy(document.json), _Buffers(), {}
    accessors = objects(json, "accessors")
    elsewhere = {container[key] for container, key in other_slots(json)}
    inputs = {sampler[key] for sampler, key in sampler_slots(json) if key == "input"}
    for number in sorted({sampler[key] for sampler, key in sampler_slots(json)} - elsewhere):
        if "bufferView" in accessors[number] and "sparse" not in accessors[number]:
            numbers[number] = raw_numbers(document, number)
    groups = grouped(numbers, inputs)
    moved = {number for group in groups for number in group.numbers}
    slots: dict[int, list[Json]] = defaultdict(list)
    others = [part for number, part in enumerate(accessors) if number not in moved]
    for part in (others, {key: value for key, value in json.items() if key not in ("accessors", "bufferViews")}):
        for container, _ in view_slots({"parts": part}):
            slots[container["bufferView"]].append(container)
    indices = {
        it["indices"] for mesh in objects(json, "meshes") for it in objects(mesh, "primitives") if "indices" in it
    }
    of_indices = {accessors[number].get("bufferView") for number in indices}
    for number, containers in sorted(slots.items()):
        new = _repacked(document, number, containers, streams, buffers, number in of_indices)
        for container in containers:
            container["bufferView"] = new
    for group in groups:
        stream, offset = encoded(group.elements), 0
        view = buffers.add_stream({}, streams.name, _extension_content(group.filter, group.elements), stream)
        for number in group.numbers:
            accessor = accessors[number]
            accessor["bufferView"] = view
            accessor.pop("byteOffset", None)
            if offset:
                accessor["byteOffset"] = offset
            offset += len(numbers[number]) * group.elements.shape[1]
    return _with_buffers(document, json, buffers)


def shortened(document: Document) -> Document:
    """Return a document in which the rest transforms of nodes have only the digits that single precision needs."""
    with np.errstate(over="ignore"):
        nodes = [
            {
                key: list(map(_short, value)) if key in TRANSFORMS and isinstance(value, list) else value
                for key, value in node.items()
            }
            for node in objects(document.json, "nodes")
        ]
    return replace(document, json={**document.json, "nodes": nodes}) if nodes else document


def _short(number: float) -> float:
    """Return the shortest decimal number with the same single-precision value; unchanged if it has no exact one."""
    if not isinstance(number, float) or float(single := np.float32(number)) != number:
        return number
    return float(str(single))


def _repacked(
    document: Document, number: int, containers: list[Json], streams: Streams, buffers: _Buffers, are_indices: bool
) -> int:
    """Add a view compressed as far as possible without loss, and return its new number."""
    view = document.json["bufferViews"][number]
    if (compression := _compression(view)) is not None:  # Damaged, and used by meshes only.
        name, own = compression
        return buffers.add_stream(view, name, own, _stream(document, own, MAX_DOCUMENT_BYTES))
    data, first, length = document.buffers[view["buffer"]], whole(view, "byteOffset", 0), whole(view, "byteLength")
    if data is None or first + length > len(data):
        raise GltfError(f"view {number} reaches beyond its buffer")
    content = bytes(data[first : first + length])
    if content in streams.known:
        return buffers.add_stream(view, *streams.known[content])
    stride = _stride(document, view, containers)
    if stride and not are_indices and stride % 4 == 0 and stride <= MAX_ELEMENT_BYTES and length % stride == 0:
        elements = np.frombuffer(content, np.uint8).reshape(-1, stride)
        stream, own = encoded(elements), _extension_content(NO_FILTER, elements)
        if len(stream) + len(as_text({streams.name: own})) < length:
            return buffers.add_stream(view, streams.name, own, stream)
    return buffers.add(view, content)


def _stride(document: Document, view: Json, containers: list[Json]) -> int:
    """Return the stride that all accessors of a view share; 0 if they differ."""
    if not all("componentType" in it and "count" in it and "sparse" not in it for it in containers):
        return 0
    accessors = objects(document.json, "accessors")
    widths = {stored_size({"accessors": [it]}, 0) // whole(it, "count", least=1) for it in containers if accessors}
    if "byteStride" in view:
        return whole(view, "byteStride")
    even = all(whole(it, "byteOffset", 0) % max(widths, default=1) == 0 for it in containers)
    return widths.pop() if len(widths) == 1 and even else 0


def _with_buffers(document: Document, json: Json, buffers: _Buffers) -> Document:
    """Return the document with these buffers, and with its lists of extensions updated."""
    own: Json = {"byteLength": max(len(buffers.data), 1)}
    given = objects(document.json, "buffers")
    if document.chunks is None:
        beside = any(isinstance(it.get("uri"), str) and not it["uri"].startswith("data:") for it in given)
        own["uri"] = "buffer.bin" if beside else data_uri(bytes(buffers.data))
    json["buffers"] = [own]
    for name, size in buffers.sizes.items():
        json["buffers"].append({"byteLength": size, "extensions": {name: {"fallback": True}}})
    json["bufferViews"] = buffers.views
    for key in ("extensionsUsed", "extensionsRequired"):
        kept = [name for name in json.get(key, []) if name not in COMPRESSIONS]
        json[key] = kept + list(buffers.sizes)
        if not json[key]:
            del json[key]
    contents = bytes(buffers.data) or bytes(1), *[None] * len(buffers.sizes)
    return replace(document, json=json, buffers=contents, changed=frozenset({0}), original=None)


def are_clear(json: Json) -> bool:
    """Whether all places that name views and buffers of the document are known."""
    references = References(json)
    return not references.unclear and not references.buffers_are_named
