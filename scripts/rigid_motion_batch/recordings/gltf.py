"""glTF and GLB files by Blender's own importer: the whole skeleton as Blender shows it.

The importer gets a copy of what makes a skeleton and its skin, in a folder that is gone afterwards: no images, nor
what extensions and extras say, and buffers only from the folder of the file. Key times are seconds; a skeleton is
sampled as often as the keys of its densest track come, or 60 times a second where they tell no rate.
Source: the glTF 2.0 specification, Khronos 2021.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np

from rigid_motion.gltf.documents import (
    BINARY_CHUNK,
    JSON_CHUNK,
    MAGIC,
    GltfError,
    bytes_of_uri,
    chunks_of,
    file_of,
    is_data,
    parsed,
)

from .bvh import DEEPEST, MOST_JOINTS, MOST_POSES
from .gltf_tracks import straightened
from .importing import read_imported, refuse_too_large
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError

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
    content = path.read_bytes()
    try:
        parts = dict(reversed(chunks_of(content))) if content.startswith(MAGIC) else {JSON_CHUNK: content}
        chunks = cast(dict[bytes, bytes], parts)  # parts of bytes are bytes
        document = parsed(chunks[JSON_CHUNK])
        others = _buffers(path, document)
    except GltfError as error:
        raise TrajectoryError(path, error.problem, error.way_out) from None
    binary = chunks.get(BINARY_CHUNK)
    refuse_too_large(path, *others.values())
    _refuse_made_up(path, document)
    _refuse_too_many(path, document)
    with TemporaryDirectory(prefix="rigid_motion_") as folder:
        copy, made = _copy(Path(folder), document, binary, others)
        return read_imported(path, selection, lambda: _import(copy), ADDON, _rate, options.scale, FPS, made * FPS)


def _rate(_: float, keys: float | None) -> float:
    return keys or WITHOUT_A_RATE


def _buffers(path: Path, document: dict[str, Any]) -> dict[int, Path]:
    """Return the files that buffers are in, by their numbers, all of them in the folder of the file or below."""
    buffers = document.get("buffers")
    uris = [
        buffer.get("uri") if isinstance(buffer, dict) else None
        for buffer in (buffers if isinstance(buffers, list) else ())
    ]
    return {
        number: file_of(path.parent, number, uri)
        for number, uri in enumerate(uris)
        if uri is not None and not is_data(uri)
    }


def _refuse_made_up(path: Path, document: dict[str, Any]) -> None:
    """Raise TrajectoryError for more numbers than are read: what no buffer holds is zeros, and may be any number."""
    accessors = document.get("accessors")
    counts = (
        [accessor.get("count") for accessor in accessors if isinstance(accessor, dict)]
        if isinstance(accessors, list)
        else []
    )
    total = sum(count for count in counts if isinstance(count, int) and count > 0)
    if total > MOST_POSES:
        problem = f"{total} numbers, vectors and matrices are more than {MOST_POSES}"
        raise TrajectoryError(path, problem, "export the skeleton without its meshes, or split the recording")


def _refuse_too_many(path: Path, document: dict[str, Any]) -> None:
    """Raise TrajectoryError for more nodes, joints or channels than Blender's importer is done with in seconds."""
    nodes, skins, animations = (_objects(document.get(name)) for name in ("nodes", "skins", "animations"))
    joints = max((len(joints) for skin in skins if isinstance(joints := skin.get("joints"), list)), default=0)
    channels = sum(len(_objects(animation.get("channels"))) for animation in animations)
    fewer = "export the skeleton alone, without the rest of its scene"
    for count, most, kind, way_out in (
        (len(nodes), MOST_NODES, "nodes", fewer),
        (joints, MOST_JOINTS, "joints of a skin", "export one body at a time"),
        (channels, MOST_CHANNELS, "animated channels", "export fewer takes"),
    ):
        if count > most:
            raise TrajectoryError(path, f"{count} {kind} are more than the {most} that are read", way_out)
    if _depth(nodes) > DEEPEST:
        problem = f"more than {DEEPEST} nodes hang on one another"
        raise TrajectoryError(path, problem, "export a shorter chain")


def _objects(part: Any) -> list[dict[str, Any]]:
    return [item for item in part if isinstance(item, dict)] if isinstance(part, list) else []


def _depth(nodes: list[dict[str, Any]]) -> int:
    """Return how many nodes hang on one another at most; `DEEPEST` and one more where they hang on themselves."""
    children = [node.get("children") for node in nodes]
    below = [
        [child for child in own if isinstance(child, int) and child in range(len(nodes))]
        if isinstance(own, list)
        else []
        for own in children
    ]
    level, depth = set(range(len(nodes))), 0
    while level and depth <= DEEPEST:
        level, depth = {child for node in level for child in below[node]}, depth + 1
    return depth


def _copy(
    folder: Path, document: dict[str, Any], binary: bytes | None, others: dict[int, Path]
) -> tuple[Path, np.ndarray]:
    """Return what Blender is to import, in a folder, and the times of keys in it that are in no track of the file."""
    plain = {name: _plain(part) for name, part in document.items() if name in PARTS}
    for number, other in others.items():
        plain["buffers"][number]["uri"] = name = f"buffer{number}.bin"
        shutil.copyfile(other, folder / name)
    buffers = plain.get("buffers")
    first = buffers[0] if isinstance(buffers, list) and buffers else None
    if binary is not None and isinstance(first, dict) and first.get("uri") is None:
        (folder / "binary.bin").write_bytes(binary)
        first["uri"] = "binary.bin"
    more, made = straightened(plain, lambda number: _bytes_of(folder, plain["buffers"][number]))
    if more:
        (folder / "more.bin").write_bytes(more)
        plain["buffers"][-1]["uri"] = "more.bin"
    copy = folder / "copy.gltf"
    copy.write_text(json.dumps(plain), encoding="utf-8")
    return copy, made


def _bytes_of(folder: Path, buffer: dict[str, Any]) -> bytes:
    uri = buffer["uri"]
    return bytes_of_uri(uri) if is_data(uri) else (folder / uri).read_bytes()


def _plain(part: Any) -> Any:
    """Return a part of the document without materials, extras, and extensions that do more than compress."""
    if isinstance(part, list):
        return [_plain(item) for item in part]
    if not isinstance(part, dict):
        return part
    plain = {name: _plain(one) for name, one in part.items() if name not in ("extensions", "extras", "material")}
    extensions = part.get("extensions")
    if isinstance(extensions, dict) and (
        kept := {name: extensions[name] for name in COMPRESSIONS if name in extensions}
    ):
        plain["extensions"] = kept
    return plain


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
