"""Tracks of glTF animations as Blender's importer understands them, which knows neither tangents nor even turns.

It takes cubic splines without their tangents, and turns on straight lines of quaternions. So splines become so many
keys with straight lines between them, and wide turns narrower ones, as the specification has them (glTF 2.0, appendix
C).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from rigid_motion.gltf.accessors import COMPONENTS, KINDS, denormalised
from rigid_motion.motion.repair import LARGEST

WIDEST = np.radians(25.0)
"""Widest turn from key to key that gets no keys between: a line of quaternions is then off by 0.3 milliradians."""

OF_A_BONE = 1e-3
"""Part of the length of a usual bone that lines may be off from a spline of places."""

OF_A_TURN = 2.5e-4
"""Distance that lines may be off from a spline of quaternions or scales."""

MOST_PARTS = 64
"""Parts of a segment of a spline."""

MOST_KEYS = 200_000
"""Keys of a track that is made; one with more is left to Blender."""

DAMAGED = (KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError)
"""Errors that damaged files lead to: Blender's importer says what is wrong with them."""


def straightened(document: dict[str, Any], bytes_of: Callable[[int], bytes]) -> tuple[bytes, np.ndarray]:
    """Have all tracks of a document run straight; what is new is in one more buffer.

    Parameters
    ----------
    document : dict
        The JSON of a glTF file, which is changed.
    bytes_of : callable
        Given the number of a buffer: what is in it.

    Returns
    -------
    data : bytes
        What is in the new buffer, the last of the document. Empty where none is needed.
    times : array, shape (n,)
        Seconds at which there are keys now, and no track had one before.
    """
    made = _Made(document, bytes_of)
    lists: list[Any] = [document.get(name) for name in ("buffers", "bufferViews", "accessors", "animations")]
    for animation in lists[-1] if all(isinstance(some, list) for some in lists) else ():
        try:
            turns = {
                (channel["target"]["path"], channel["sampler"])
                for channel in animation["channels"]
                if channel["target"]
            }
            samplers = animation["samplers"]
        except DAMAGED:
            continue
        for path, number in turns:
            try:
                if path in ("translation", "rotation", "scale"):
                    with np.errstate(all="raise", under="ignore"):
                        samplers[number] = made.sampler(samplers[number], path)
            except DAMAGED:
                continue
    return made.finish()


class _Made:
    """The numbers of a document, and those that come to them."""

    def __init__(self, document: dict[str, Any], bytes_of: Callable[[int], bytes]) -> None:
        self._document, self._bytes_of = document, cache(lambda number: memoryview(bytes_of(number)))
        self._data = bytearray()
        self._length = _usual_length(document)
        self._known: list[np.ndarray] = []
        self._times: list[np.ndarray] = []

    def sampler(self, sampler: dict[str, Any], path: str) -> dict[str, Any]:
        """Return the same sampler, or one with more keys."""
        kind, times = sampler.get("interpolation", "LINEAR"), self._read(sampler["input"])[:, 0]
        self._known.append(times)
        if kind == "STEP" or (kind == "LINEAR" and path != "rotation"):
            return sampler
        values, steps = self._read(sampler["output"]), np.diff(times)
        if not (len(times) > 1 and np.isfinite(times).all() and np.isfinite(values).all() and (steps > 0.0).all()):
            return sampler
        if kind == "CUBICSPLINE":
            tolerance = self._length * OF_A_BONE if path == "translation" else OF_A_TURN
            times, values = _of_spline(times, values.reshape(len(times), 3, -1), tolerance, path == "rotation")
        elif len(values) != len(times):
            return sampler
        if path == "rotation":
            times, values = _of_turns(times, values)
        if kind == "LINEAR" and len(times) == len(steps) + 1:
            return sampler
        if len(times) > MOST_KEYS:
            return sampler
        self._times.append(times)
        return {
            "input": self._add(times[:, None], "SCALAR"),
            "output": self._add(values, "VEC4" if path == "rotation" else "VEC3"),
            "interpolation": "LINEAR",
        }

    def finish(self) -> tuple[bytes, np.ndarray]:
        """Return what has come to the document, which it gets a buffer for, and the times that are new."""
        if not self._data:
            return b"", np.empty(0)
        self._document["buffers"].append({"byteLength": len(self._data)})
        known, times = (np.concatenate(some).astype(np.float32) for some in (self._known, self._times))
        return bytes(self._data), np.setdiff1d(times, known).astype(np.float64)

    def _read(self, number: int) -> np.ndarray:
        """Read the numbers of an accessor, shape (n, components). Raises ValueError for one that is kept otherwise."""
        accessor = self._document["accessors"][number]
        view = self._document["bufferViews"][accessor["bufferView"]]
        if "sparse" in accessor or view.get("extensions"):
            raise ValueError("sparse or compressed")
        kind = np.dtype(KINDS[accessor["componentType"]])
        count, width = accessor["count"], COMPONENTS[accessor["type"]]
        stride = view.get("byteStride") or kind.itemsize * width
        first = view.get("byteOffset", 0)
        data = self._bytes_of(view["buffer"])[first : first + view["byteLength"]][accessor.get("byteOffset", 0) :]
        if not 0 < count * stride <= len(data) + stride - kind.itemsize * width:
            raise ValueError("not as many as it says")
        result = np.ndarray((count, width), kind, data, strides=(stride, kind.itemsize))
        return result.astype(np.float64) if kind.kind == "f" else denormalised(result)

    def _add(self, numbers: np.ndarray, kind: str) -> int:
        numbers = numbers.astype("<f4")
        views, accessors = self._document["bufferViews"], self._document["accessors"]
        buffers = self._document["buffers"]
        views.append({"buffer": len(buffers), "byteOffset": len(self._data), "byteLength": numbers.nbytes})
        accessor = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(numbers), "type": kind}
        if kind == "SCALAR":
            accessor |= {"min": [float(numbers.min())], "max": [float(numbers.max())]}
        accessors.append(accessor)
        self._data += numbers.tobytes()
        return len(accessors) - 1


def _usual_length(document: dict[str, Any]) -> float:
    """Return how far joints are from their parents, as a rule: the median."""
    try:
        joints = {joint for skin in document["skins"] for joint in skin["joints"]}
        lengths = [math.hypot(*document["nodes"][joint].get("translation", ())) for joint in joints]
    except DAMAGED:
        lengths = []
    usable = [length for length in lengths if 0.0 < length < LARGEST]
    return float(np.median(usable)) if usable else 1.0


def _of_spline(times: np.ndarray, rows: np.ndarray, tolerance: float, turns: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return keys on a spline of rows (n, 3, components): tangent before a key, its value, and tangent after."""
    steps = np.diff(times)
    begin, end = rows[:-1, 1], rows[1:, 1]
    out, into = rows[:-1, 2] * steps[:, None], rows[1:, 0] * steps[:, None]
    bends = [6.0 * (end - begin) - 4.0 * out - 2.0 * into, 6.0 * (begin - end) + 2.0 * out + 4.0 * into]
    bend = np.maximum(*(np.linalg.norm(some, axis=-1) for some in bends))
    parts = np.ceil(np.sqrt(bend / (8.0 * tolerance))).clip(1, MOST_PARTS).astype(np.int64)
    segment, share = _split(parts)
    s, a, b = share[:, None], begin[segment], end[segment]
    values = (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * out[segment]
    values += (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * into[segment]
    values = np.concatenate((values, end[-1:]))
    if turns:
        values /= np.linalg.norm(values, axis=-1, keepdims=True)
    return np.append(times[segment] + share * steps[segment], times[-1]), values


def _of_turns(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return keys of quaternions (n, 4), and more on even turns between those that are far apart."""
    values = values / np.linalg.norm(values, axis=-1, keepdims=True)
    a, b = values[:-1], values[1:]
    dots = np.sum(a * b, axis=-1)
    half = np.arccos(np.abs(dots).clip(max=1.0))
    segment, share = _split(np.ceil(2.0 * half / WIDEST).clip(1).astype(np.int64))
    between = share > 0.0
    part, angle = share[between], half[segment[between]]
    rows = values[segment]
    first, last = np.sin((1.0 - part) * angle), np.sin(part * angle) * np.where(dots < 0.0, -1.0, 1.0)[segment[between]]
    rows[between] = first[:, None] * a[segment[between]] + last[:, None] * b[segment[between]]
    rows[between] /= np.sin(angle)[:, None]
    places = times[segment] + share * np.diff(times)[segment]
    return np.append(places, times[-1]), np.concatenate((rows, values[-1:]))


def _split(parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the segment in which each part begins, and how far along it, of segments in so many parts."""
    segment = np.repeat(np.arange(len(parts)), parts)
    return segment, (np.arange(len(segment)) - (np.cumsum(parts) - parts)[segment]) / parts[segment]
