"""Animations of a glTF document as typed tracks: which nodes they move, and their values at any time.

Times are in seconds, lengths in the document's unit, which glTF defines as the metre. Quaternions are w, x, y, z here,
as everywhere in this program; files have x, y, z, w.
Source: the glTF 2.0 specification, Khronos 2021, section 3.11 and appendix C.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..motion.quaternions import normalise, turned_at
from .accessors import ALL_ROWS, MOST_ZEROS, Rows, numbers
from .documents import Document, GltfError, Json, bytes_of, entry, objects, shown

TRANSLATION, ROTATION, SCALE, WEIGHTS = PATHS = ("translation", "rotation", "scale", "weights")

LINEAR, STEP, CUBICSPLINE = INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")

NUMBERS_PER_KEY = {TRANSLATION: 3, ROTATION: 4, SCALE: 3}
"""Number of values in a key."""

TO_WXYZ, TO_XYZW = [3, 0, 1, 2], [1, 2, 3, 0]

AT_ONCE = 2**14
"""Keys of a track processed in one go."""

MOST_SHARED = 4
"""Most values in all tracks together, for each byte of a file: a key of 16-bit integers shared by eight tracks."""

MAX_NUMBER = 1e30
"""Larger numbers are damage: their squares would overflow single precision."""


@dataclass(frozen=True, eq=False)
class Track:
    """The animation of one node property by a channel."""

    channel: int
    """Number of the channel in the animation."""

    node: int
    path: str
    """One of PATHS."""

    interpolation: str
    """One of INTERPOLATIONS."""

    times: np.ndarray
    """Key times in seconds, shape (n,), strictly rising."""

    values: Any
    """An array, or an object that is read when sliced like one, shape (n, width).

    For a cubic spline (n, 3, width): tangent before the key, value, tangent after it.
    """

    @property
    def size(self) -> int:
        """Number of values in its keys, including times."""
        return len(self.times) + int(self.values.size)

    @property
    def points(self) -> np.ndarray:
        """The values of the keys without tangents, shape (n, width)."""
        values = self.values[:]
        return values[:, 1] if self.interpolation == CUBICSPLINE else values

    @property
    def whole(self) -> Track:
        """The same track with all values read."""
        return replace(self, values=self.values[:])

    @property
    def is_constant(self) -> bool:
        """Whether the value is the same at all times."""
        tangents = self.interpolation == CUBICSPLINE and len(self.times) > 1 and self.values[:][:, [0, 2]].any()
        points = self.points
        return not tangents and bool(np.all(points == points[0]))

    def shows(self, other: Track) -> bool:
        """Whether another track has the same keys."""
        same = self.interpolation == other.interpolation and np.array_equal(self.times, other.times)
        return same and np.array_equal(self.values[:], other.values[:])

    def near(self, first: float, last: float) -> Track:
        """Return the keys that affect a time range; they are read from the file if needed."""
        begin = max(int(np.searchsorted(self.times, first, side="right")) - 1, 0)
        some = slice(begin, max(int(np.searchsorted(self.times, last)) + 1, begin + 1))
        return replace(self, times=self.times[some], values=self.values[some])

    def keyed(self, times: np.ndarray) -> Track:
        """Return a track with keys at these times (m,) and lines in between."""
        return replace(self, interpolation=LINEAR, times=times, values=self.at(times))

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at rising `times`, shape (m, width). Quaternions are normalised."""
        first, last = np.searchsorted(self.times, times[[0, -1]]).tolist()
        if last - first > AT_ONCE and len(times) > 1:
            return np.concatenate([self.at(some) for some in np.array_split(times, 2)])
        return self.near(times[0], times[-1])._at(times)

    def _at(self, times: np.ndarray) -> np.ndarray:
        times = np.clip(times, self.times[0], self.times[-1])
        if len(self.times) == 1:
            result = np.repeat(self.points, len(times), axis=0)
        elif np.array_equal(times, self.times):
            result = self.points
        elif self.interpolation == STEP:
            result = self.values[np.searchsorted(self.times, times, side="right") - 1]
        elif self.interpolation == CUBICSPLINE:
            result = self._on_spline(times)
        elif self.path == ROTATION:
            return turned_at(self.times, self.values, times)
        else:
            result = np.stack([np.interp(times, self.times, column) for column in self.values.T], axis=1)
        return normalise(result) if self.path == ROTATION else result

    def _on_spline(self, times: np.ndarray) -> np.ndarray:
        keys = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        length = (self.times[keys + 1] - self.times[keys])[:, None]
        s = (times - self.times[keys])[:, None] / length
        out, into = length * self.values[keys, 2], length * self.values[keys + 1, 0]
        result = (2 * s**3 - 3 * s**2 + 1) * self.values[keys, 1] + (s**3 - 2 * s**2 + s) * out
        return result + (3 * s**2 - 2 * s**3) * self.values[keys + 1, 1] + (s**3 - s**2) * into


NODE_POINTER = re.compile(r"/nodes/(\d{1,9})/(translation|rotation|scale|weights)")

MAY_MOVE = re.compile(r"/(nodes|meshes|skins)/(?!.*/extensions/)")
"""Pointers that may affect visible geometry."""

Target = tuple[int, str]
"""A node and its path."""

Tracks = Mapping[Target, Track]


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation of a document."""

    number: int
    name: str
    tracks: tuple[Track, ...]
    """Channels that move nodes."""

    pointers: tuple[Track, ...] = ()
    """The same for channels of KHR_animation_pointer."""

    unread: str = ""
    """A pointer that may move visible geometry in an unknown way."""

    @property
    def all_tracks(self) -> tuple[Track, ...]:
        return self.tracks + self.pointers


def read_clips(document: Document) -> tuple[Clip, ...]:
    """Return all animations of a document.

    Raises
    ------
    GltfError
        Names the animation and the channel that cannot be read.
    """
    most = MOST_ZEROS + MOST_SHARED * bytes_of(document)
    times: dict[int, np.ndarray] = {}
    clips = []
    for number in range(len(objects(document.json, "animations"))):
        clips.append(_clip(document, number, times, most))
        most -= sum(track.values.size for track in clips[-1].all_tracks)
    return tuple(clips)


def moves_node(target: Json) -> bool:
    """Whether a channel target is a node with a path of core glTF."""
    return "node" in target and target.get("path") in PATHS


def _clip(document: Document, number: int, times: dict[int, np.ndarray], most: int) -> Clip:
    animation = document.json["animations"][number]
    name = animation.get("name")
    name = name if isinstance(name, str) and name else f"animation {number}"
    tracks: list[Track] = []
    pointers: list[Track] = []
    targets, unread = set(), ""
    for index, channel in enumerate(objects(animation, "channels")):
        target = channel.get("target")
        if not isinstance(target, dict):
            raise GltfError(f"{shown(name)}: channel {index} has no target")
        pointer = _pointer(target)
        known = NODE_POINTER.fullmatch(pointer)
        if not moves_node(target) and not known:
            unread = unread or (pointer if MAY_MOVE.match(pointer) else "")
            continue
        node, path = (int(known[1]), known[2]) if known else (target["node"], target["path"])
        try:
            track = _track(document, animation, index, channel, node, path, times)
        except GltfError as error:
            raise GltfError(f"{shown(name)}: channel {index}: {error.problem}", error.way_out) from None
        if (track.node, track.path) in targets:
            raise GltfError(f"{shown(name)}: channel {index} is the second {track.path} of node {track.node}")
        targets.add((track.node, track.path))
        (pointers if known else tracks).append(track)
        most -= track.values.size
        if most < 0:
            problem = f"{shown(name)}: channel {index}: too many channels share the numbers of so small a file"
            raise GltfError(problem, "export fewer clips")
    return Clip(number, name, tuple(tracks), tuple(pointers), unread)


def _pointer(target: Json) -> str:
    """Return the pointer of a KHR_animation_pointer channel; empty for other channels."""
    extensions = target.get("extensions")
    own = extensions.get("KHR_animation_pointer") if isinstance(extensions, dict) else None
    pointer = own.get("pointer") if isinstance(own, dict) else None
    return pointer if isinstance(pointer, str) else ""


def _track(
    document: Document, animation: Json, index: int, channel: Json, node: int, path: str, known: dict[int, np.ndarray]
) -> Track:
    """Return a channel as a track; key times are cached by accessor in `known`."""
    moved = entry(document.json, "nodes", node)
    if "matrix" in moved and path != WEIGHTS:
        raise GltfError(f"node {node} has a matrix, and glTF moves nodes without one alone")
    sampler = entry(animation, "samplers", channel.get("sampler"))
    interpolation = sampler.get("interpolation", LINEAR)
    if interpolation not in INTERPOLATIONS:
        raise GltfError(f"the interpolation {shown(interpolation)} is none of {', '.join(INTERPOLATIONS)}")
    given: Any = sampler.get("input")
    if given not in known:
        known[given] = _times(document, given)
    times, values = known[given], numbers(document, sampler.get("output"))
    width, uneven = divmod(values.size, len(times) * (3 if interpolation == CUBICSPLINE else 1))
    if uneven or not width or width != NUMBERS_PER_KEY.get(path, width) or (path == WEIGHTS) != (values.shape[1] == 1):
        raise GltfError(f"{len(values)} values do not fit {len(times)} keys of {path}")
    if interpolation == CUBICSPLINE and len(times) < 2:
        raise GltfError("a spline needs two keys at least")
    if np.abs(values).max() > MAX_NUMBER:
        raise GltfError("it has numbers that are too large")
    shape: tuple[int, ...] = (3, width) if interpolation == CUBICSPLINE else (width,)
    rows = Rows(document, sampler["output"], len(times), shape, TO_WXYZ if path == ROTATION else ALL_ROWS)
    track = Track(index, node, path, interpolation, times, rows)
    if path == ROTATION and not np.linalg.norm(track.points, axis=1).all():
        raise GltfError("it has a quaternion of length zero")
    return track


def _times(document: Document, number: object) -> np.ndarray:
    """Return key times, shape (n,).

    Two keys at the same time are a cut: the first is moved earlier, by one step of single precision.
    """
    times = numbers(document, number)
    if times.shape[1] != 1:
        raise GltfError("its times are no single numbers")
    times = times[:, 0]
    if np.abs(times).max() > MAX_NUMBER:
        raise GltfError("it has numbers that are too large")
    (cuts,), rising = np.nonzero(np.diff(times) == 0.0), times.copy()
    rising[cuts] = np.nextafter(times[cuts].astype(np.float32), -np.float32(np.inf))
    (falls,) = np.nonzero(np.diff(rising) <= 0.0)
    if len(falls):
        first, second = times[falls[0] :][:2]
        raise GltfError(
            f"its times do not rise ({first:.6g} s, then {second:.6g} s)",
            "take keys out until one comes after the other, and two are at one time at most",
        )
    return rising
