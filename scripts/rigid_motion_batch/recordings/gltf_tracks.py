"""Tracks of glTF animations as Blender's importer understands them, which knows neither tangents nor even turns.

It takes cubic splines without their tangents, and turns on straight lines of quaternions. So splines become so many
keys with straight lines between them, and wide turns narrower ones, as the specification has them (glTF 2.0, appendix
C).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rigid_motion.gltf.accessors import GrowingView, numbers
from rigid_motion.gltf.documents import Document, Json, objects
from rigid_motion.gltf.tracks import CUBICSPLINE, LINEAR, ROTATION, STEP, TRANSLATION, WIDTHS, Track
from rigid_motion.motion.quaternions import normalise
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


def straightened(document: Document) -> tuple[Document, np.ndarray]:
    """Have all tracks of a document run straight; what is new is in one more buffer.

    Parameters
    ----------
    document : Document
        Its JSON is changed.

    Returns
    -------
    document : Document
    times : array, shape (n,)
        Seconds at which there are keys now, and no track had one before.
    """
    json, length = document.json, _usual_length(document.json)
    known, made = [np.empty(0)], [np.empty(0)]
    try:
        view = GrowingView(json)
    except DAMAGED:
        return document, made[0]
    for animation in objects(json, "animations"):
        try:
            channels = [channel for channel in animation["channels"] if channel["target"]]
            turns = {(channel["target"]["path"], channel["sampler"]) for channel in channels}
            samplers = animation["samplers"]
        except DAMAGED:
            continue
        for path, number in turns:
            try:
                track = _track(document, samplers[number], path)
                known.append(track.times)
                with np.errstate(all="raise", under="ignore"):
                    straight = _straight(track, length)
                if straight is not track and len(straight.times) <= MOST_KEYS:
                    made.append(straight.times)
                    parts = (straight.times[:, None], True), (straight.values, False)
                    times, values = (view.add(part.astype("<f4"), bounds=bounds) for part, bounds in parts)
                    samplers[number] = {"input": times, "output": values, "interpolation": LINEAR}
            except DAMAGED:
                continue
    if not view.data:
        json["bufferViews"].pop()
        return document, made[0]
    view.json |= {"buffer": len(document.buffers), "byteLength": len(view.data)}
    json["buffers"].append({"byteLength": len(view.data), "uri": "made.bin"})
    before, moments = (np.concatenate(some).astype(np.float32) for some in (known, made))
    result = replace(document, buffers=(*document.buffers, bytes(view.data)))
    return result, np.setdiff1d(moments, before).astype(np.float64)


def _track(document: Document, sampler: Json, path: str) -> Track:
    """Return what a sampler does; quaternions are x, y, z, w, as in the file. Raises ValueError for what is none."""
    kind, times = sampler.get("interpolation", LINEAR), numbers(document, sampler["input"])[:, 0]
    shape = (len(times), 3, WIDTHS[path]) if kind == CUBICSPLINE else (len(times), WIDTHS[path])
    return Track(0, 0, path, kind, times, numbers(document, sampler["output"]).reshape(shape))


def _straight(track: Track, length: float) -> Track:
    """Return a track between whose keys lines are right, which may be the same; bones are of a usual length."""
    steps = np.diff(track.times)
    if track.interpolation == STEP or not len(steps) or not (steps > 0.0).all():
        return track
    if track.interpolation == CUBICSPLINE:
        tolerance = length * OF_A_BONE if track.path == TRANSLATION else OF_A_TURN
        parts = np.ceil(np.sqrt(_bends(track, steps) / (8.0 * tolerance))).clip(1, MOST_PARTS)
        track = track.keyed(_split(track.times, parts))
    if track.path == ROTATION:
        turns = normalise(track.values)
        half = np.arccos(np.abs(np.sum(turns[:-1] * turns[1:], axis=-1)).clip(max=1.0))
        parts = np.ceil(2.0 * half / WIDEST).clip(1)
        track = track.keyed(_split(track.times, parts)) if (parts > 1).any() else track
    return track


def _bends(track: Track, steps: np.ndarray) -> np.ndarray:
    """Return the largest second derivative of each segment of a spline, in its own time, shape (n - 1,)."""
    begin, end = track.values[:-1, 1], track.values[1:, 1]
    out, into = track.values[:-1, 2] * steps[:, None], track.values[1:, 0] * steps[:, None]
    bends = [6.0 * (end - begin) - 4.0 * out - 2.0 * into, 6.0 * (begin - end) + 2.0 * out + 4.0 * into]
    return np.maximum(*(np.linalg.norm(some, axis=-1) for some in bends))


def _split(times: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Return times (n,) with the segments between them in so many parts (n - 1,)."""
    parts = parts.astype(np.int64)
    segment = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(segment)) - (np.cumsum(parts) - parts)[segment]) / parts[segment]
    return np.append(times[segment] + share * np.diff(times)[segment], times[-1])


def _usual_length(json: Json) -> float:
    """Return how far joints are from their parents, as a rule: the median."""
    try:
        joints = {joint for skin in json["skins"] for joint in skin["joints"]}
        lengths = [math.hypot(*json["nodes"][joint].get("translation", ())) for joint in joints]
    except DAMAGED:
        lengths = []
    usable = [length for length in lengths if 0.0 < length < LARGEST]
    return float(np.median(usable)) if usable else 1.0
