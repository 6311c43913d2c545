"""glTF and GLB files by Blender's own importer: the whole skeleton as Blender shows it.

The importer gets a copy of what makes a skeleton and its skin, in a folder that is gone afterwards: no images, nor
what extensions and extras say, and buffers only from the folder of the file. Key times are seconds; a skeleton is
sampled as often as the keys of its densest track come, or 60 times a second where they tell no rate.

The importer knows neither tangents nor even turns: it takes cubic splines without their tangents, and turns on straight
lines of quaternions. So splines become so many keys with straight lines between them, and wide turns narrower ones, as
the specification has them (appendix C).
Source: the glTF 2.0 specification, Khronos 2021.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from rigid_motion.gltf.accessors import GrowingView, numbers
from rigid_motion.gltf.documents import Document, FileBytes, GltfError, Json, damage_refused, objects, read_document
from rigid_motion.gltf.nodes import Nodes
from rigid_motion.gltf.tracks import CUBICSPLINE, LINEAR, ROTATION, STEP, TRANSLATION, WIDTHS, Track
from rigid_motion.motion.quaternions import normalise
from rigid_motion.motion.repair import LARGEST

from .bvh import MOST_JOINTS, MOST_POSES
from .importing import read_imported, refuse_too_large
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError

ENDINGS = (".glb", ".gltf", ".vrm", ".vrma")
"""Of glTF files: avatars and animations for them, VRM and VRMA, are GLB files."""

ADDON = "io_scene_gltf2"

WITHOUT_A_RATE = 60.0
"""Frames a second where keys come too seldom or too often to tell."""

FPS = 120
"""Frames a second of the scene: keys at 24, 30 or 60 a second are on whole frames of it."""

PARTS = {
    *("asset", "scene", "scenes", "nodes", "meshes", "skins", "animations", "accessors", "bufferViews", "buffers"),
    *("extensionsUsed", "extensionsRequired"),
}
"""Parts of a document that make a skeleton that moves, and its skin."""

COMPRESSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression")
"""Extensions without which the numbers cannot be read."""

MOST_NODES = 10_000
"""Nodes of a file, also those that are no joints: Blender takes seconds, four times as long for twice as many."""

MOST_CHANNELS = 100_000
"""Channels of all takes together: each becomes up to four F-curves."""


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the whole skeleton; or bones that are named, or all."""
    refuse_too_large(path)
    try:
        document = read_document(path)
        beside = {buffer.path for buffer in document.buffers if isinstance(buffer, FileBytes)} - {path}
        refuse_too_large(path, *beside)
        _refuse_too_many(path, document.json)
        with damage_refused():
            Nodes(document)  # Refuses those that hang on themselves, or too many on one another.
        parts = {name: _stripped(part) for name, part in document.json.items() if name in PARTS}
        copy, made = straightened(replace(document, json=parts))
        name = f"copy{'.gltf' if copy.chunks is None else '.glb'}"
        # Buffers in files of their own are written beside the copy.
        files = replace(copy, changed=frozenset(range(len(copy.buffers)))).files(name)
    except GltfError as error:
        raise TrajectoryError(path, error.problem, error.way_out) from None
    with TemporaryDirectory(prefix="rigid_motion_") as folder:
        for file, content in files.items():
            (Path(folder) / file).write_bytes(content)
        importer = Path(folder) / name
        how: dict[str, Any] = {"fps": FPS, "usual": WITHOUT_A_RATE, "made": made * FPS}
        return read_imported(path, selection, lambda: _import(importer), ADDON, options.scale, **how)


def _refuse_too_many(path: Path, json: Json) -> None:
    """Raise TrajectoryError for more than Blender's importer is done with in seconds: nodes, joints or channels.

    And for more numbers than are read: what no buffer holds is zeros, and may be any number.
    """
    nodes, skins, animations, accessors = (
        objects(json, name) for name in ("nodes", "skins", "animations", "accessors")
    )
    counts = (accessor.get("count") for accessor in accessors)
    numbers = sum(count for count in counts if isinstance(count, int) and count > 0)
    joints = max((len(joints) for skin in skins if isinstance(joints := skin.get("joints"), list)), default=0)
    channels = sum(len(objects(animation, "channels")) for animation in animations)
    fewer = "export the skeleton alone, without the rest of its scene"
    without = "export the skeleton without its meshes, or split the recording"
    for count, most, kind, way_out in (
        (numbers, MOST_POSES, "numbers, vectors and matrices", without),
        (len(nodes), MOST_NODES, "nodes", fewer),
        (joints, MOST_JOINTS, "joints of a skin", "export one body at a time"),
        (channels, MOST_CHANNELS, "animated channels", "export fewer takes"),
    ):
        if count > most:
            raise TrajectoryError(path, f"{count} {kind} are more than the {most} that are read", way_out)


def _stripped(part: Any) -> Any:
    """Return a part of the document without materials, extras, and extensions that do more than compress."""
    if isinstance(part, list):
        return [_stripped(item) for item in part]
    if not isinstance(part, dict):
        return part
    kept = {name: _stripped(below) for name, below in part.items() if name not in ("extensions", "extras", "material")}
    extensions = part.get("extensions")
    if isinstance(extensions, dict) and (
        known := {name: extensions[name] for name in COMPRESSIONS if name in extensions}
    ):
        kept["extensions"] = known
    return kept


def _import(copy: Path) -> None:
    import bpy

    bpy.ops.import_scene.gltf(
        filepath=str(copy),
        import_pack_images=False,
        import_shading="SMOOTH",
        disable_bone_shape=True,
        import_scene_extras=False,
        import_select_created_objects=False,
    )


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
