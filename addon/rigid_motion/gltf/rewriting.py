"""Documents with other animations: nothing else changes but the numbers of accessors, views and where bytes are.

What animations alone used goes out of the buffers, also out of views that meshes are in, and what they use now comes in
behind the rest, in one view. Views and images that stay have the same bytes. Of files with extensions that are not
known here, see `references`.

How tracks are stored, what they show then, and how many bytes that takes, is told as well.
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
"""Bytes go out of buffers in multiples of it, so that what stays is aligned as it was."""

Range = tuple[int, int]
"""The first byte, and that behind the last."""

Ranges = dict[int, list[Range]]
"""By the number of a buffer."""

MAX_INT16 = np.iinfo(np.int16).max
"""What stands for 1 where 16-bit integers are normalised."""

FLOAT_BYTES, SHORT_BYTES = 4, 2
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


def with_tracks(
    document: Document, references: References, tracks: Mapping[int, Sequence[StoredTrack]]
) -> tuple[Document, frozenset[int]]:
    """Return the document with these tracks in its animations, by their numbers, and those that have theirs.

    Animations with extensions that are not known stay as they are. Channels of the others that are not among the tracks
    go, but for those that move no node or that extensions define. What several animations share goes with the last of
    them that uses it.
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
        """By the number of a view: the accessors in it, and ELSEWHERE for all else that names it."""
        of_accessors = [(slot, number) for number, part in enumerate(self.accessors) for slot in view_slots(part)]
        owners = {id(container): number for (container, _), number in of_accessors}
        for container, key in view_slots(self.json):
            self.view_users[container[key]].append(owners.get(id(container), NO_ANIMATION))
        for number, animation_tracks in tracks.items():
            self._put(objects(self.json, "animations")[number], animation_tracks)
        used_after = {container[key] for container, key in sampler_slots(self.json)}
        self.unused = {
            number for number, users in references.users.items() if users <= set(tracks) and number not in used_after
        }

    def done(self) -> Document:
        removed = self._views_that_go()
        slots = [*sampler_slots(self.json), *other_slots(self.json)]
        document = self._with_bytes(removed)
        self._take_out("accessors", self.unused, slots, {"componentType": 5126, "count": 1, "type": "SCALAR"})
        nothing = {"buffer": self.view.json["buffer"], "byteLength": 1}
        self._take_out("bufferViews", removed, list(view_slots(self.json)), nothing)
        return document

    def _put(self, animation: Json, tracks: Sequence[StoredTrack]) -> None:
        """Give an animation these tracks and no others."""
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
                if sampler["interpolation"] == LINEAR:  # goes without saying
                    del sampler["interpolation"]
            elif moves_node(channel["target"]):
                continue
            same = numbers.setdefault(as_text(sampler), len(samplers))
            if same == len(samplers):
                samplers.append(sampler)
            channels.append({**channel, "sampler": same})
        animation["channels"], animation["samplers"] = channels, samplers

    def _views_that_go(self) -> set[int]:
        """Return the views in which there is nothing but numbers that are not used any more."""
        views = self.view_users.keys() - self.references.unclear
        return {view for view in views if self.unused.issuperset(self.view_users[view])}

    def _take_out(self, name: str, unused: set[int], slots: list[Slot], nothing: Json) -> None:
        """Take entries out of a list, and say so wherever others are named, or have nothing in their places."""
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
        """Return the document with its bytes: without those that are not used any more, and with the new ones."""
        contents: list[Any] = list(self.before.buffers)
        goes, stays = self._ranges(removed)
        target = max(
            (number for number, content in enumerate(contents) if content is not None),
            key=lambda number: sum(end - first for first, end in goes.get(number, ())),
            default=len(contents),
        )
        if target == len(contents):
            # A first buffer may be that inside of a GLB.
            has_room = self.before.chunks is not None and not contents
            self.json.setdefault("buffers", []).append({"byteLength": 0} | ({} if has_room else {"uri": data_uri(b"")}))
            contents.append(b"")
        changed = {target, *(number for number in goes if contents[number] is not None)}
        cuts = {
            buffer: [] if self.references.buffers_are_named else _cuts(goes.get(buffer, []), stays.get(buffer, []))
            for buffer in changed
        }
        self._close_up(cuts)
        for buffer in changed:
            contents[buffer] = _without(contents[buffer], cuts[buffer])
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
        """Return what may go of each buffer and what stays, which may be the same."""
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

    def _close_up(self, cuts: Ranges) -> None:
        """Say where all is once these bytes have gone out of buffers."""
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
    """Where bytes of a buffer are once some are gone: by where they were."""

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
    """Yield what names bytes of a buffer: a view, and the compressed form of it."""
    yield view
    for extension in view.get("extensions", {}).values():
        if isinstance(extension, dict) and {"buffer", "byteLength"} <= extension.keys():
            yield extension


def _range(view: Json) -> Range:
    first = whole(view, "byteOffset", 0)
    return first, first + whole(view, "byteLength")


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
        values = np.rint(normalise(values) * MAX_INT16).astype(np.int16)
    else:
        values = values.astype(np.float32)
    return StoredTrack(track.channel, track.interpolation, track.times.astype(np.float32), values)


def shown(track: Track, stored: StoredTrack) -> Track:
    """Return what is shown by a track as it is stored."""
    values = denormalised(stored.values) if stored.values.dtype.kind == "i" else stored.values.astype(np.float64)
    values = values.reshape(
        (len(stored.times), 3, -1) if stored.interpolation == CUBICSPLINE else (len(stored.times), -1)
    )
    if track.path == ROTATION:
        values = values[..., TO_WXYZ]
    return replace(track, interpolation=stored.interpolation, times=stored.times.astype(np.float64), values=values)


def key_size(path: str, *, integers: bool) -> int:
    """Return the bytes of the value of a key of rotation or translation."""
    return (SHORT_BYTES if integers and path == ROTATION else FLOAT_BYTES) * NUMBERS_PER_KEY[path]


def amount(tracks: Iterable[StoredTrack]) -> Amount:
    """Keys and bytes of tracks that are to be stored; what is the same is stored once."""
    tracks = tuple(tracks)
    parts = {(part.dtype.str, part.tobytes()) for track in tracks for part in track.accessors}
    return Amount(sum(len(track.times) for track in tracks), sum(len(content) for _, content in parts))


def amount_before(
    document: Document, references: References, clip: Clip, shares: Mapping[int, float] | None = None
) -> Amount:
    """Keys and bytes of the tracks of a clip as it is in the file, without bytes that other things use as well.

    Of views that are compressed, what `shares` says by their numbers.
    """
    animation = document.json["animations"][clip.number]
    samplers = [animation["samplers"][animation["channels"][track.channel]["sampler"]] for track in clip.tracks]
    accessors = {sampler[key] for sampler in samplers for key in ("input", "output")}
    own = [number for number in accessors if NO_ANIMATION not in references.users[number]]
    packed = [(shares or {}).get(document.json["accessors"][number].get("bufferView"), 1.0) for number in own]
    size = sum(stored_size(document.json, number) * share for number, share in zip(own, packed, strict=True))
    return Amount(sum(len(track.times) for track in clip.tracks), round(size))
