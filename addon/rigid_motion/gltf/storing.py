"""How tracks are stored, what they show then, and how many bytes that takes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from .accessors import denormalised, stored_size
from .documents import Document
from .rewriting import StoredTrack
from .tracks import LINEAR, ROTATION, TO_WXYZ, TO_XYZW, WEIGHTS, WIDTHS, Clip, Track

INTEGER = np.iinfo(np.int16).max
"""What stands for 1 where 16-bit integers are normalised."""

NUMBER, SHORT = 4, 2
"""Bytes."""


@dataclass(frozen=True, eq=False)
class EveryKey:
    """The values of a track with a key at all of these times (n,), as they are shown: like an array (n, width)."""

    track: Track
    times: np.ndarray
    integers: bool

    def __len__(self) -> int:
        return len(self.times)

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
    """Return a track without tangents as it is stored; rotations as 16-bit integers where these are asked for."""
    values = track.values[..., TO_XYZW] if track.path == ROTATION else track.values
    values = values.reshape(-1, 1 if track.path == WEIGHTS else values.shape[-1])
    if integers and is_integral(track):
        values = np.rint(values * INTEGER).astype(np.int16)
    else:
        values = values.astype(np.float32)
    return StoredTrack(track.channel, track.interpolation, track.times.astype(np.float32), values)


def is_integral(track: Track) -> bool:
    """Whether a track may be stored as integers."""
    return track.path == ROTATION and track.interpolation == LINEAR


def shown(track: Track, stored: StoredTrack) -> Track:
    """Return what is shown by a track as it is stored."""
    values = denormalised(stored.values) if stored.values.dtype.kind == "i" else stored.values.astype(np.float64)
    values = values.reshape(len(stored.times), -1)
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
