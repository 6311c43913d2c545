"""Replacing the animations of a glTF document: nothing else changes but numbers of accessors and views, and offsets.

Bytes that only animations used are removed from the buffers, also from views shared with meshes. The new ones are
appended at the end, in one view. Views and images that stay have the same bytes. For files with unknown extensions see
`references`.

This module also converts tracks to their stored form and back, and computes their sizes in bytes.
"""

from __future__ import annotations

import copy
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import numpy as np

from ..motion.quaternions import normalise
from .accessors import GrowingView, denormalised, parts_of, stored_size
from .documents import Document, FileBytes, Json, as_text, data_uri, is_data, objects, whole
from .references import NO_ANIMATION, References, Slot, other_slots, sampler_slots, unknown, view_slots
from .tracks import CUBICSPLINE, LINEAR, NUMBERS_PER_KEY, ROTATION, TO_WXYZ, TO_XYZW, WEIGHTS, Clip, Track, moves_node

ALIGNMENT_BYTES = 8
"""Bytes are removed in multiples of this, so that the rest stays aligned."""

Range = tuple[int, int]
"""First byte and end (exclusive)."""

Ranges = dict[int, list[Range]]
"""Byte ranges by buffer number."""

MAX_INT16 = np.iinfo(np.int16).max
"""Value that stands for 1 in normalised 16-bit integers."""

FLOAT_BYTES, SHORT_BYTES = 4, 2
"""Bytes of a float and of a 16-bit integer."""


@dataclass(frozen=True, eq=False)
class StoredTrack:
    """A track in stored form, for a channel of an animation."""

    channel: int
    interpolation: str
    times: np.ndarray
    """Shape (n,), float32."""

    values: np.ndarray
    """Shape (rows, columns), float32 or normalised int16; quaternions are x, y, z, w."""

    @property
    def accessors(self) -> tuple[np.ndarray, np.ndarray]:
        """Arrays (count, columns) for the accessors of key times and of values."""
        return self.times[:, None], self.values


def with_tracks(
    document: Document, references: References, tracks: Mapping[int, Sequence[StoredTrack]]
) -> tuple[Document, frozenset[int]]:
    """Return the document with these tracks by animation number, and the numbers of the changed animations.

    Animations with unknown extensions stay unchanged. In the others, channels without a new track are removed, except
    channels that move no node or belong to extensions. Data shared by several animations is removed with the last user.
    """
    animations = objects(document.json, "animations")
    chosen = {number: new for number, new in tracks.items() if not any(unknown(animations[number]))}
    return (_Rewriting(document, references, chosen).done() if chosen else document), frozenset(chosen)


class _Rewriting:
    def __init__(self, document: Document, references: References, tracks: Mapping[int, Sequence[StoredTrack]]) -> None:
        self.before, self.references = document, references
        self.json: Json = copy.deepcopy(document.json)
        self.view = GrowingView(self.json)
        self.accessors, self.views = self.json["accessors"], self.json["bufferViews"]
        self.first_new = len(document.json.get("accessors", ()))
        self.view_users: dict[int, list[int]] = defaultdict(list)
        """By view number: the accessors in it, and NO_ANIMATION for anything else that names it."""
        of_accessors = [(slot, number) for number, part in enumerate(self.accessors) for slot in view_slots(part)]
        owners = {id(container): number for (container, _), number in of_accessors}
        for container, key in view_slots(self.json):
            self.view_users[container[key]].append(owners.get(id(container), NO_ANIMATION))
        for number, animation_tracks in tracks.items():
            self._set_tracks(objects(self.json, "animations")[number], animation_tracks)
        used_after = {container[key] for container, key in sampler_slots(self.json)}
        self.unused = {
            number for number, users in references.users.items() if users <= set(tracks) and number not in used_after
        }

    def done(self) -> Document:
        removed = self._views_that_go()
        slots = [*sampler_slots(self.json), *other_slots(self.json)]
        document = self._with_bytes(removed)
        self._remove_entries("accessors", self.unused, slots, {"componentType": 5126, "count": 1, "type": "SCALAR"})
        nothing = {"buffer": self.view.json["buffer"], "byteLength": 1}
        self._remove_entries("bufferViews", removed, list(view_slots(self.json)), nothing)
        return document

    def _set_tracks(self, animation: Json, tracks: Sequence[StoredTrack]) -> None:
        """Replace the tracks of an animation by these."""
        new = {track.channel: track for track in tracks}
        channels: list[Json] = []
        samplers: list[Json] = []
        numbers: dict[bytes, int] = {}
        for number, channel in enumerate(animation["channels"]):
            sampler = dict(animation["samplers"][channel["sampler"]])
            if number in new:
                times, values = new[number].accessors
                sampler |= {"input": self.view.add(times, bounds=True), "output": self.view.add(values)}
                sampler["interpolation"] = new[number].interpolation
                if sampler["interpolation"] == LINEAR:  # The default of glTF.
                    del sampler["interpolation"]
            elif moves_node(channel["target"]):
                continue
            same = numbers.setdefault(as_text(sampler), len(samplers))
            if same == len(samplers):
                samplers.append(sampler)
            channels.append({**channel, "sampler": same})
        animation["channels"], animation["samplers"] = channels, samplers

    def _views_that_go(self) -> set[int]:
        """Return the views that contain only unused numbers."""
        views = self.view_users.keys() - self.references.unclear
        return {view for view in views if self.unused.issuperset(self.view_users[view])}

    def _remove_entries(self, name: str, unused: set[int], slots: list[Slot], nothing: Json) -> None:
        """Remove entries from a list and update all references, or put `nothing` in their places."""
        listed = self.json[name]
        if self.references.unclear:
            for number in unused:
                listed[number] = dict(nothing)
        else:
            kept = [number for number in range(len(listed)) if number not in unused]
            numbers = {before: after for after, before in enumerate(kept)}
            listed[:] = [listed[number] for number in kept]
            for container, key in slots:
                if container[key] in numbers:
                    container[key] = numbers[container[key]]
        if not listed:
            del self.json[name]

    def _with_bytes(self, removed: set[int]) -> Document:
        """Return the document with its bytes: unused bytes removed, new bytes added."""
        contents: list[Any] = list(self.before.buffers)
        goes, stays = self._ranges(removed)
        target = max(
            (number for number, content in enumerate(contents) if content is not None),
            key=lambda number: sum(end - first for first, end in goes.get(number, ())),
            default=len(contents),
        )
        if target == len(contents):
            # A first buffer may be the one inside the GLB.
            has_room = self.before.chunks is not None and not contents
            self.json.setdefault("buffers", []).append({"byteLength": 0} | ({} if has_room else {"uri": data_uri(b"")}))
            contents.append(b"")
        changed = {target, *(number for number in goes if contents[number] is not None)}
        cuts = {
            buffer: [] if self.references.buffers_are_named else _cuts(goes.get(buffer, []), stays.get(buffer, []))
            for buffer in changed
        }
        self._update_offsets(cuts)
        for buffer in changed:
            contents[buffer] = _without_ranges(contents[buffer], cuts[buffer])
        view = self.view.json
        view |= {"buffer": target, "byteLength": len(self.view.data)}
        padded = contents[target] + bytes(-len(contents[target]) % ALIGNMENT_BYTES)
        if padded:
            view["byteOffset"] = len(padded)
        if self.view.data:
            contents[target] = padded + bytes(self.view.data)
        else:
            self.views.pop()
        for buffer in changed:
            contents[buffer] = contents[buffer] or bytes(ALIGNMENT_BYTES)
            described = self.json["buffers"][buffer]
            described["byteLength"] = len(contents[buffer])
            if is_data(described.get("uri")):
                described["uri"] = data_uri(contents[buffer])
        buffers = tuple(contents)
        return replace(
            self.before, json=self.json, buffers=buffers, changed=self.before.changed | changed, original=None
        )

    def _ranges(self, removed: set[int]) -> tuple[Ranges, Ranges]:
        """Return for each buffer the ranges that may be removed and the ranges that stay; they may overlap."""
        goes: Ranges = defaultdict(list)
        stays: Ranges = defaultdict(list)
        for number, view in enumerate(self.views[:-1]):
            first, end = _range(view)
            users, spans = set(self.view_users.get(number, ())), list(_spans(view))
            shared = users & self.unused and NO_ANIMATION not in users and number not in self.references.unclear
            if number in removed:
                goes[view["buffer"]].append((first, end))
            elif not shared or len(spans) > 1:
                for span in spans:
                    stays[span["buffer"]].append(_range(span))
            else:
                for accessor in users:
                    ranges = goes if accessor in self.unused else stays
                    ranges[view["buffer"]] += [
                        (first + begin, first + behind)
                        for part, begin, behind in parts_of(self.json, accessor)
                        if part["bufferView"] == number
                    ]
        return goes, stays

    def _update_offsets(self, cuts: Ranges) -> None:
        """Update all offsets and lengths for these bytes removed from buffers."""
        moved = {buffer: _Moved(ranges) for buffer, ranges in cuts.items() if ranges}
        for accessor in self.accessors[: self.first_new]:
            for part, _ in view_slots(accessor):
                view = self.views[part["bufferView"]]
                if view["buffer"] in moved:
                    first, _ = _range(view)
                    to = moved[view["buffer"]]
                    _set_offset(part, to[first + whole(part, "byteOffset", 0)] - to[first])
        for view in self.views[:-1]:
            for span in _spans(view):
                if span["buffer"] in moved:
                    (first, end), to = _range(span), moved[span["buffer"]]
                    _set_offset(span, to[first])
                    span["byteLength"] = to[end] - to[first]


class _Moved:
    """New offsets in a buffer after ranges have been removed, by old offset."""

    def __init__(self, cuts: list[Range]) -> None:
        self.firsts, self.ends = ([cut[side] for cut in cuts] for side in (0, 1))
        self.gone = list(accumulate((end - first for first, end in cuts), initial=0))

    def __getitem__(self, offset: int) -> int:
        before = bisect_left(self.firsts, offset)
        return offset - self.gone[before] + (max(self.ends[before - 1] - offset, 0) if before else 0)


def _set_offset(part: Json, offset: int) -> None:
    if offset or "byteOffset" in part:
        part["byteOffset"] = offset


def _spans(view: Json) -> Iterator[Json]:
    """Yield the parts of a view that name bytes of a buffer: the view itself, and its compressed form."""
    yield view
    for extension in view.get("extensions", {}).values():
        if isinstance(extension, dict) and {"buffer", "byteLength"} <= extension.keys():
            yield extension


def _range(view: Json) -> Range:
    first = whole(view, "byteOffset", 0)
    return first, first + whole(view, "byteLength")


def _cuts(removed: list[Range], kept: list[Range]) -> list[Range]:
    """Return the ranges that can be removed from a buffer: without the kept ranges, aligned, rising."""
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
    # Padding between two removed ranges, which nothing refers to, is removed with them.
    free[1:-1] |= ~stays[1:-1] & free[:-2] & free[2:] & (np.diff(offsets)[1:] < ALIGNMENT_BYTES)
    result: list[Range] = []
    for first, end in zip(offsets[:-1][free[:-1]].tolist(), offsets[1:][free[:-1]].tolist(), strict=True):
        if result and result[-1][1] == first:
            first = result.pop()[0]
        result.append((first, end))
    aligned = [
        (-(-first // ALIGNMENT_BYTES) * ALIGNMENT_BYTES, end // ALIGNMENT_BYTES * ALIGNMENT_BYTES)
        for first, end in result
    ]
    return [(first, end) for first, end in aligned if first < end]


def _without_ranges(data: bytes | FileBytes, cuts: list[Range]) -> bytes:
    begins, ends = [0, *(end for _, end in cuts)], [*(first for first, _ in cuts), len(data)]
    return b"".join(bytes(data[first:end]) for first, end in zip(begins, ends, strict=True))


@dataclass(frozen=True, eq=False)
class EveryKey:
    """Values as shown by a track with a key at each of these times (n,): like an array (n, width)."""

    track: Track
    times: np.ndarray
    integers: bool

    def __getitem__(self, rows: slice) -> np.ndarray:
        keyed = self.track.keyed(self.times[rows])
        return shown(keyed, stored(keyed, integers=self.integers)).values


@dataclass(frozen=True)
class Amount:
    """The keys and bytes of a clip."""

    keys: int
    """Number of keys of all channels together."""

    size: int
    """Bytes of key times and values."""


def stored(track: Track, *, integers: bool) -> StoredTrack:
    """Return a track in stored form, rotations as 16-bit integers if `integers` is set."""
    values = track.values[..., TO_XYZW] if track.path == ROTATION else track.values
    values = values.reshape(-1, 1 if track.path == WEIGHTS else values.shape[-1])
    if integers and track.path == ROTATION and track.interpolation == LINEAR:
        values = np.rint(normalise(values) * MAX_INT16).astype(np.int16)
    else:
        values = values.astype(np.float32)
    return StoredTrack(track.channel, track.interpolation, track.times.astype(np.float32), values)


def shown(track: Track, stored: StoredTrack) -> Track:
    """Return the track that is shown for a stored track."""
    values = denormalised(stored.values) if stored.values.dtype.kind == "i" else stored.values.astype(np.float64)
    values = values.reshape(
        (len(stored.times), 3, -1) if stored.interpolation == CUBICSPLINE else (len(stored.times), -1)
    )
    if track.path == ROTATION:
        values = values[..., TO_WXYZ]
    return replace(track, interpolation=stored.interpolation, times=stored.times.astype(np.float64), values=values)


def key_size(path: str, *, integers: bool) -> int:
    """Return the bytes of one key's value, for rotation or translation."""
    return (SHORT_BYTES if integers and path == ROTATION else FLOAT_BYTES) * NUMBERS_PER_KEY[path]


def amount(tracks: Iterable[StoredTrack]) -> Amount:
    """Return keys and bytes of stored tracks; equal arrays are stored once."""
    tracks = tuple(tracks)
    parts = {(part.dtype.str, part.tobytes()) for track in tracks for part in track.accessors}
    return Amount(sum(len(track.times) for track in tracks), sum(len(content) for _, content in parts))


def amount_before(
    document: Document, references: References, clip: Clip, shares: Mapping[int, float] | None = None
) -> Amount:
    """Return keys and bytes of the tracks of a clip in the file, without bytes that other things use as well.

    Bytes in compressed views are scaled by `shares`, by view number.
    """
    animation = document.json["animations"][clip.number]
    samplers = [animation["samplers"][animation["channels"][track.channel]["sampler"]] for track in clip.tracks]
    accessors = {sampler[key] for sampler in samplers for key in ("input", "output")}
    own = [number for number in accessors if NO_ANIMATION not in references.users[number]]
    packed = [(shares or {}).get(document.json["accessors"][number].get("bufferView"), 1.0) for number in own]
    size = sum(stored_size(document.json, number) * share for number, share in zip(own, packed, strict=True))
    return Amount(sum(len(track.times) for track in clip.tracks), round(size))
