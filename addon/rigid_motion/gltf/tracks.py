"""Animations of a glTF document as typed tracks: what moves which node, and what it shows at any time.

Times are seconds, lengths are those of the document, which glTF means to be metres. Quaternions are w, x, y, z here,
as everywhere in this program; files have x, y, z, w.
Source: the glTF 2.0 specification, Khronos 2021, section 3.11 and appendix C.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import Poses, interpolate
from ..motion.quaternions import normalise
from .accessors import numbers
from .documents import Document, GltfError, Json, entry, objects, shown

TRANSLATION, ROTATION, SCALE, WEIGHTS = PATHS = ("translation", "rotation", "scale", "weights")

LINEAR, STEP, CUBICSPLINE = INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")

WIDTHS = {TRANSLATION: 3, ROTATION: 4, SCALE: 3}
"""Numbers of a key."""

TO_WXYZ, TO_XYZW = [3, 0, 1, 2], [1, 2, 3, 0]

FARTHEST = 1e30
"""Numbers beyond it are damage: their squares would be no floats in single precision."""


@dataclass(frozen=True, eq=False)
class Track:
    """What one channel of an animation does to a node."""

    channel: int
    """Its number in the animation."""

    node: int
    path: str
    """One of PATHS."""

    interpolation: str
    """One of INTERPOLATIONS."""

    times: np.ndarray
    """Of the keys in seconds, shape (n,), strictly rising."""

    values: np.ndarray
    """Shape (n, width); of a cubic spline (n, 3, width): tangent before the key, its value, tangent after it."""

    @property
    def points(self) -> np.ndarray:
        """The values of the keys without their tangents, shape (n, width)."""
        return self.values[:, 1] if self.interpolation == CUBICSPLINE else self.values

    @property
    def is_constant(self) -> bool:
        """Whether it is the same at all times."""
        tangents = self.interpolation == CUBICSPLINE and len(self.times) > 1 and self.values[:, [0, 2]].any()
        return not tangents and bool(np.all(self.points == self.points[0]))

    def at(self, times: np.ndarray) -> np.ndarray:
        """What is shown at `times`, which rise, shape (m, width). Quaternions are normalised."""
        times = np.clip(times, self.times[0], self.times[-1])
        if len(self.times) == 1:
            found = np.repeat(self.points, len(times), axis=0)
        elif self.interpolation == STEP:
            found = self.values[np.searchsorted(self.times, times, side="right") - 1]
        elif self.interpolation == CUBICSPLINE:
            found = self._on_spline(times)
        elif self.path == ROTATION:
            first = max(int(np.searchsorted(self.times, times[0], side="right")) - 1, 0)
            near = slice(min(first, len(self.times) - 2), int(np.searchsorted(self.times, times[-1])) + 1)
            return turned_at(self.times[near], self.values[near], times)
        else:
            found = np.stack([np.interp(times, self.times, column) for column in self.values.T], axis=1)
        return normalise(found) if self.path == ROTATION else found

    def _on_spline(self, times: np.ndarray) -> np.ndarray:
        keys = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        length = (self.times[keys + 1] - self.times[keys])[:, None]
        s = (times - self.times[keys])[:, None] / length
        out, into = length * self.values[keys, 2], length * self.values[keys + 1, 0]
        found = (2 * s**3 - 3 * s**2 + 1) * self.values[keys, 1] + (s**3 - 2 * s**2 + s) * out
        return found + (3 * s**2 - 2 * s**3) * self.values[keys + 1, 1] + (s**3 - s**2) * into


def turned_at(key_times: np.ndarray, keys: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Quaternions (m, 4) at times between keys (n, 4), each on the short way at an even speed."""
    return interpolate(key_times, Poses(np.zeros((len(keys), 3)), keys), times, "lerp_slerp").quaternions


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation of a document."""

    number: int
    name: str
    tracks: tuple[Track, ...]
    """What moves nodes: channels without a node, or with paths of extensions, are not among them."""


def read_clips(document: Document) -> tuple[Clip, ...]:
    """All animations of a document.

    Raises
    ------
    GltfError
        That names the animation and the channel that cannot be read.
    """
    return tuple(_clip(document, number) for number in range(len(objects(document.json, "animations"))))


def _clip(document: Document, number: int) -> Clip:
    animation = document.json["animations"][number]
    name = animation.get("name")
    name = name if isinstance(name, str) and name else f"animation {number}"
    tracks, targets = [], set()
    for place, channel in enumerate(objects(animation, "channels")):
        target = channel.get("target")
        if not isinstance(target, dict):
            raise GltfError(f"{shown(name)}: channel {place} has no target")
        if "node" not in target or target.get("path") not in PATHS:
            continue
        try:
            track = _track(document, animation, place, channel)
        except GltfError as error:
            raise GltfError(f"{shown(name)}: channel {place}: {error.problem}", error.way_out) from None
        if (track.node, track.path) in targets:
            raise GltfError(f"{shown(name)}: channel {place} is the second {track.path} of node {track.node}")
        targets.add((track.node, track.path))
        tracks.append(track)
    return Clip(number, name, tuple(tracks))


def _track(document: Document, animation: Json, place: int, channel: Json) -> Track:
    node, path = channel["target"]["node"], channel["target"]["path"]
    moved = entry(document.json, "nodes", node)
    if "matrix" in moved and path != WEIGHTS:
        raise GltfError(f"node {node} has a matrix, and glTF moves nodes without one alone")
    sampler = entry(animation, "samplers", channel.get("sampler"))
    interpolation = sampler.get("interpolation", LINEAR)
    if interpolation not in INTERPOLATIONS:
        raise GltfError(f"the interpolation {shown(interpolation)} is none of {', '.join(INTERPOLATIONS)}")
    times, values = numbers(document, sampler.get("input")), numbers(document, sampler.get("output"))
    if times.shape[1] != 1 or np.any(np.diff(times[:, 0]) <= 0.0):
        raise GltfError("its times do not rise")
    rows = len(times) * (3 if interpolation == CUBICSPLINE else 1)
    width, uneven = divmod(values.size, rows)
    if uneven or not width or width != WIDTHS.get(path, width) or (path == WEIGHTS) != (values.shape[1] == 1):
        raise GltfError(f"{len(values)} values do not fit {len(times)} keys of {path}")
    if interpolation == CUBICSPLINE and len(times) < 2:
        raise GltfError("a spline needs two keys at least")
    if np.abs(values).max() > FARTHEST or np.abs(times).max() > FARTHEST:
        raise GltfError("it has numbers that are too large")
    values = values.reshape((len(times), 3, width) if interpolation == CUBICSPLINE else (len(times), width))
    if path == ROTATION:
        values = values[..., TO_WXYZ]
    track = Track(place, node, path, interpolation, times[:, 0], values)
    if path == ROTATION and not np.linalg.norm(track.points, axis=1).all():
        raise GltfError("it has a quaternion of length zero")
    return track
