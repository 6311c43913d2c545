"""Documents with other animations: nothing else changes but the numbers of accessors, views and where bytes are.

What animations alone used goes out of the buffers, what they use now comes in behind the rest, in one view. Views and
images that stay have the same bytes. In files with extensions that are not known here, which may name accessors and
views in ways of their own, all that stays keeps its number.

How tracks are stored, what they show then, and how many bytes that takes, is told as well.
"""

from __future__ import annotations

import copy
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .accessors import GrowingView, denormalised, raw_numbers, stored_size
from .documents import Document, FileBytes, Json, data_uri, is_data, objects
from .tracks import CUBICSPLINE, LINEAR, ROTATION, TO_WXYZ, TO_XYZW, WEIGHTS, WIDTHS, Clip, Track, moves_node

KNOWN = re.compile(
    "(?:KHR|EXT)_(?:materials|texture|lights|mesh|animation|node|xmp)_.*|.*_meshopt_compression"
    "|KHR_draco_mesh_compression|KHR_xmp|KHR_techniques_webgl|MSFT_(?:lod|texture_dds|packing_.*)|VRM.*"
)
"""Extensions whose numbers of accessors and views are found below, or that have none."""

INSTANCES = "EXT_mesh_gpu_instancing"

ALIGNED = 8
"""Bytes go out of buffers in multiples of it, so that what stays is aligned as it was."""

Range = tuple[int, int]
"""The first byte, and that behind the last."""

INTEGER = np.iinfo(np.int16).max
"""What stands for 1 where 16-bit integers are normalised."""

NUMBER, SHORT = 4, 2
"""Bytes."""


@dataclass(frozen=True, eq=False)
class StoredTrack:
    """A track as it is to be stored, for a channel of an animation."""

    channel: int
    interpolation: str
    times: np.ndarray
    """Shape (n,), float32."""

    values: np.ndarray
    """Shape (rows, columns), float32 or int16, which is normalised; quaternions are x, y, z, w."""

    @property
    def accessors(self) -> tuple[np.ndarray, np.ndarray]:
        """Of keys and of values, each (count, columns)."""
        return self.times[:, None], self.values


def rewritten(document: Document, tracks: Mapping[int, Sequence[StoredTrack]]) -> Document:
    """Return the document with other tracks in animations, by their numbers.

    Their channels that are not among the tracks go, but for those that move no node or that extensions define.
    """
    return _Rewriting(document, tracks).done()


class _Rewriting:
    def __init__(self, document: Document, tracks: Mapping[int, Sequence[StoredTrack]]) -> None:
        self.before, self.tracks = document, tracks
        self.json: Json = copy.deepcopy(document.json)
        self.view = GrowingView(self.json)
        self.accessors, self.views = self.json["accessors"], self.json["bufferViews"]
        self.first_new = len(self.accessors)
        self.keeps_numbers = not all(
            isinstance(name, str) and KNOWN.fullmatch(name) for name in self.json.get("extensionsUsed", ())
        )

    def done(self) -> Document:
        before = {container[key] for container, key in _sampler_slots(self.json)}
        others = {container[key] for container, key in _other_slots(self.json)}
        for number, tracks in self.tracks.items():
            self._put(objects(self.json, "animations")[number], tracks)
        after = {container[key] for container, key in _sampler_slots(self.json)}
        unused = before - after - others
        removed = self._views_without(unused, before - others)
        for number in after - others:
            if number < self.first_new and removed & set(_views_of(self.accessors[number])):
                self._move(number)
        self.view.json["byteLength"] = max(len(self.view.data), 1)
        slots = [*_sampler_slots(self.json), *_other_slots(self.json)]
        self._renumber("accessors", unused, slots, {"componentType": 5126, "count": 1, "type": "SCALAR"})
        buffers = self._buffers(removed)
        self._renumber("bufferViews", removed, list(_view_slots(self.json)), {**self.view.json, "byteLength": 1})
        return buffers

    def _put(self, animation: Json, tracks: Sequence[StoredTrack]) -> None:
        """Give an animation these tracks and no others."""
        new = {track.channel: track for track in tracks}
        channels, samplers = [], []
        for number, channel in enumerate(animation["channels"]):
            sampler = dict(animation["samplers"][channel["sampler"]])
            if number in new:
                times, values = (
                    self.view.add(numbers, bounds=numbers.shape[1] == 1) for numbers in new[number].accessors
                )
                sampler |= {"input": times, "output": values}
                if sampler.get("interpolation", LINEAR) != new[number].interpolation:
                    sampler["interpolation"] = new[number].interpolation
            elif moves_node(channel["target"]):
                continue
            samplers.append(sampler)
            channels.append({**channel, "sampler": len(samplers) - 1})
        animation["channels"], animation["samplers"] = channels, samplers

    def _move(self, number: int) -> None:
        """Bring what an accessor has into the new view: that which it is in goes."""
        accessor, content = self.accessors[number], raw_numbers(self.before, number)
        accessor.pop("byteOffset", None)
        accessor.pop("sparse", None)
        accessor |= self.view.placed(content.tobytes())

    def _views_without(self, unused: set[int], of_animations: set[int]) -> set[int]:
        """Return the views that animations alone use, and some of which they use no more."""
        uses = Counter(container[key] for container, key in _view_slots(self.json))
        owned = Counter(view for number in of_animations for view in _views_of(self.accessors[number]))
        free = {view for view, count in owned.items() if count == uses[view]}
        return free & {view for number in unused for view in _views_of(self.accessors[number])}

    def _renumber(self, name: str, unused: set[int], slots: list[tuple[Any, Any]], nothing: Json) -> None:
        """Take entries out of a list, the last ones into their places, and say so wherever they are named."""
        listed = self.json[name]
        if self.keeps_numbers:
            for number in unused:
                listed[number] = dict(nothing)
            return
        kept = [number for number in range(len(listed)) if number not in unused]
        numbers = {before: after for after, before in enumerate(kept)}
        listed[:] = [listed[number] for number in kept]
        for container, key in slots:
            if container[key] in numbers:
                container[key] = numbers[container[key]]

    def _buffers(self, removed: set[int]) -> Document:
        """Return the document with its bytes: without those of views that were removed, and with the new ones."""
        json = self.json
        contents: list[Any] = list(self.before.buffers)
        ranges: dict[int, list[Range]] = {}
        for number in sorted(removed):
            view = self.views[number]
            ranges.setdefault(view["buffer"], []).append(_range(view))
        target = max(ranges, key=lambda buffer: sum(end - first for first, end in ranges[buffer]), default=-1)
        if target < 0:
            target = len(contents)
            # A first buffer may be that inside of a GLB.
            has_room = self.before.chunks is not None and not self.before.buffers
            json.setdefault("buffers", []).append({"byteLength": 0} | ({} if has_room else {"uri": data_uri(b"")}))
            contents.append(b"")
        users = [user for number, view in enumerate(self.views[:-1]) if number not in removed for user in _spans(view)]
        for buffer in {*ranges, target}:
            own = [user for user in users if user.get("buffer") == buffer]
            cuts = _cuts(ranges.get(buffer, []), [_range(user) for user in own])
            for user in own:
                offset = user.get("byteOffset", 0)
                if (moved := offset - sum(end - first for first, end in cuts if end <= offset)) != offset:
                    user["byteOffset"] = moved
            contents[buffer] = _without(contents[buffer], cuts)
        view = self.view.json
        view["buffer"] = target
        padded = contents[target] + bytes(-len(contents[target]) % ALIGNED)
        if padded:
            view |= {"byteOffset": len(padded)}
        contents[target] = padded + bytes(self.view.data or b"\0")
        for buffer in {*ranges, target}:
            described = json["buffers"][buffer]
            described["byteLength"] = len(contents[buffer])
            if is_data(described.get("uri")):
                described["uri"] = data_uri(contents[buffer])
        return replace(self.before, json=json, buffers=tuple(contents), changed=self.before.changed | {*ranges, target})


def _sampler_slots(json: Json) -> Iterator[tuple[Json, str]]:
    """Every place of animations that names an accessor: what it is in, and by which key."""
    for animation in objects(json, "animations"):
        for sampler in objects(animation, "samplers"):
            yield from ((sampler, key) for key in ("input", "output"))


def _other_slots(json: Json) -> Iterator[tuple[Json, str]]:
    """Every other place that does."""
    for mesh in objects(json, "meshes"):
        for primitive in objects(mesh, "primitives"):
            if "indices" in primitive:
                yield primitive, "indices"
            for attributes in (primitive.get("attributes") or {}, *objects(primitive, "targets")):
                yield from ((attributes, name) for name in attributes)
    for skin in objects(json, "skins"):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"
    for node in objects(json, "nodes"):
        attributes = node.get("extensions", {}).get(INSTANCES, {}).get("attributes", {})
        yield from ((attributes, name) for name in attributes)


def _view_slots(json: Json) -> Iterator[tuple[Json, str]]:
    """Every place that names a view, in extensions as well: all name it alike."""
    waiting: list[Any] = [part for name, part in json.items() if name != "extras"]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            if isinstance(part.get("bufferView"), int):
                yield part, "bufferView"
            waiting += [below for name, below in part.items() if name != "extras"]
        elif isinstance(part, list):
            waiting += part


def _views_of(accessor: Json) -> list[int]:
    """Return the views that an accessor is in: its own, and those of what is sparse."""
    return [container["bufferView"] for container, _ in _view_slots({"accessor": accessor})]


def _spans(view: Json) -> Iterator[Json]:
    """Yield what names bytes of a buffer: a view, and the compressed form of it."""
    yield view
    for extension in view.get("extensions", {}).values():
        if isinstance(extension, dict) and {"buffer", "byteLength"} <= extension.keys():
            yield extension


def _range(view: Json) -> Range:
    first = view.get("byteOffset", 0)
    return first, first + view["byteLength"]


def _cuts(removed: list[Range], kept: list[Range]) -> list[Range]:
    """Return what can go out of a buffer: ranges without those that stay, aligned, rising."""
    edges = sorted({offset for some in (removed, kept) for item in some for offset in item})
    if not edges:
        return []
    offsets = np.array(edges)
    counts = np.zeros((2, len(edges)), dtype=np.int64)
    for row, some in enumerate((removed, kept)):
        for first, end in some:
            counts[row, np.searchsorted(offsets, first)] += 1
            counts[row, np.searchsorted(offsets, end)] -= 1
    goes, stays = np.cumsum(counts, axis=1) > 0
    free = goes & ~stays
    # Padding between two ranges that go, which nothing names, goes with them.
    free[1:-1] |= ~stays[1:-1] & free[:-2] & free[2:] & (np.diff(offsets)[1:] < ALIGNED)
    result: list[Range] = []
    for first, end in zip(offsets[:-1][free[:-1]].tolist(), offsets[1:][free[:-1]].tolist(), strict=True):
        if result and result[-1][1] == first:
            first = result.pop()[0]
        result.append((first, end))
    aligned = [(-(-first // ALIGNED) * ALIGNED, end // ALIGNED * ALIGNED) for first, end in result]
    return [(first, end) for first, end in aligned if first < end]


def _without(data: bytes | FileBytes, cuts: list[Range]) -> bytes:
    begins, ends = [0, *(end for _, end in cuts)], [*(first for first, _ in cuts), len(data)]
    return b"".join(bytes(data[first:end]) for first, end in zip(begins, ends, strict=True))


@dataclass(frozen=True, eq=False)
class EveryKey:
    """The values of a track with a key at all of these times (n,), as they are shown: like an array (n, width)."""

    track: Track
    times: np.ndarray
    integers: bool

    def __getitem__(self, rows: slice) -> np.ndarray:
        keyed = self.track.keyed(self.times[rows])
        return shown(keyed, stored(keyed, integers=self.integers)).values


@dataclass(frozen=True)
class Amount:
    """How much there is of a clip."""

    keys: int
    """Of all channels together."""

    size: int
    """Bytes of key times and values."""


def stored(track: Track, *, integers: bool) -> StoredTrack:
    """Return a track as it is stored; rotations as 16-bit integers where these are asked for."""
    values = track.values[..., TO_XYZW] if track.path == ROTATION else track.values
    values = values.reshape(-1, 1 if track.path == WEIGHTS else values.shape[-1])
    if integers and track.path == ROTATION and track.interpolation == LINEAR:
        values = np.rint(values * INTEGER).astype(np.int16)
    else:
        values = values.astype(np.float32)
    return StoredTrack(track.channel, track.interpolation, track.times.astype(np.float32), values)


def shown(track: Track, stored: StoredTrack) -> Track:
    """Return what is shown by a track as it is stored."""
    values = denormalised(stored.values) if stored.values.dtype.kind == "i" else stored.values.astype(np.float64)
    values = values.reshape((len(stored.times), 3, -1) if stored.interpolation == CUBICSPLINE else (len(stored.times), -1))
    if track.path == ROTATION:
        values = values[..., TO_WXYZ]
    return replace(track, interpolation=stored.interpolation, times=stored.times.astype(np.float64), values=values)


def key_size(path: str, *, integers: bool) -> int:
    """Return the bytes of the value of a key of rotation or translation."""
    return (SHORT if integers and path == ROTATION else NUMBER) * WIDTHS[path]


def amount(tracks: Iterable[StoredTrack]) -> Amount:
    """Keys and bytes of tracks that are to be stored; what is the same is stored once."""
    tracks = tuple(tracks)
    parts = {(part.dtype.str, part.tobytes()) for track in tracks for part in track.accessors}
    return Amount(sum(len(track.times) for track in tracks), sum(len(content) for _, content in parts))


def amount_before(document: Document, clip: Clip) -> Amount:
    """Keys and bytes of the tracks of a clip as it is in the file."""
    animation = document.json["animations"][clip.number]
    samplers = [animation["samplers"][animation["channels"][track.channel]["sampler"]] for track in clip.tracks]
    accessors = {sampler[key] for sampler in samplers for key in ("input", "output")}
    size = sum(stored_size(document, number) for number in accessors)
    return Amount(sum(len(track.times) for track in clip.tracks), size)
