"""glTF and GLB files by Blender's own importer: the whole skeleton as Blender shows it.

The importer gets a copy of what makes a skeleton and its skin, in a folder that is gone afterwards: no images, nor
what extensions and extras say, and buffers only from the folder of the file. Key times are seconds; a skeleton is
sampled as often as the keys of its densest track come, or 60 times a second where they tell no rate.
Source: the glTF 2.0 specification, Khronos 2021.
"""

from __future__ import annotations

import json
import re
import shutil
import struct
from pathlib import Path, PurePosixPath, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import unquote

import numpy as np

from .bvh import DEEPEST, MOST_JOINTS, MOST_POSES
from .gltf_tracks import bytes_of_uri, straightened
from .importing import read_imported, refuse_too_large
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError, shown

ADDON = "io_scene_gltf2"

WITHOUT_A_RATE = 60.0
"""Frames a second where keys come too seldom or too often to tell."""

FPS = 120
"""Of the scene: keys at 24, 30 or 60 a second are on whole frames of it."""

PARTS = {
    *("asset", "scene", "scenes", "nodes", "meshes", "skins", "animations", "accessors", "bufferViews", "buffers"),
    *("extensionsUsed", "extensionsRequired"),
}
"""What makes a skeleton that moves, and its skin."""

COMPRESSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression")
"""Extensions without which the numbers cannot be read."""

MOST_NODES = 10_000
"""Of a file, with all that is no joint: Blender takes seconds for so many, and four times as long for twice as many."""

MOST_CHANNELS = 100_000
"""Of all takes together: each becomes up to four F-curves."""

MAGIC = b"glTF"

SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """The whole skeleton; or bones that are named, or all."""
    refuse_too_large(path)
    content = path.read_bytes()
    text, binary = _chunks(path, content) if content.startswith(MAGIC) else (content, None)
    try:
        document = json.loads(text.decode("utf-8-sig"))
    except (RecursionError, ValueError) as error:
        problem = f"this is no glTF (its JSON cannot be read: {' '.join(str(error).split())[:80]})"
        raise TrajectoryError(path, problem, "export it again") from None
    if not isinstance(document, dict):
        raise TrajectoryError(path, "this is no glTF (its JSON is no object)", "export it again")
    others = _buffers(path, document)
    refuse_too_large(path, *others.values())
    _refuse_made_up(path, document)
    _refuse_too_many(path, document)
    with TemporaryDirectory(prefix="rigid_motion_") as folder:
        copy, made = _copy(Path(folder), document, binary, others)
        return read_imported(path, selection, lambda: _import(copy), ADDON, _rate, options.scale, FPS, made * FPS)


def _rate(_: float, keys: float | None) -> float:
    return keys or WITHOUT_A_RATE


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a GLB file, and the bytes that come with it, if any."""
    found: dict[bytes, bytes] = {}
    place, whole = 12, len(content)
    if whole >= place:
        version, length = struct.unpack_from("<II", content, 4)
        if version != 2:
            raise TrajectoryError(path, f"this is GLB {version}, and 2 is known", "export it as glTF 2.0")
        if length > whole:
            raise TrajectoryError(path, f"{whole} of {length} bytes are here", "copy the file again, or export it anew")
        whole = length
    while place + 8 <= whole:
        length, kind = struct.unpack_from("<I4s", content, place)
        place += 8
        if place + length > whole:
            raise TrajectoryError(path, "a part of this file is longer than the whole", "export it again")
        found.setdefault(kind, content[place : place + length])
        place += length
    if b"JSON" not in found:
        raise TrajectoryError(path, "this GLB holds no JSON", "export it again")
    return found[b"JSON"], found.get(b"BIN\0")


def _buffers(path: Path, document: dict[str, Any]) -> dict[int, Path]:
    """The files that buffers are in, by their numbers.

    Raises
    ------
    TrajectoryError
        Where one is not in the folder of the file or below, or is no file.
    """
    found = {}
    buffers = document.get("buffers")
    for number, buffer in enumerate(buffers if isinstance(buffers, list) else ()):
        uri = buffer.get("uri") if isinstance(buffer, dict) else None
        if uri is None or (isinstance(uri, str) and uri[:5].lower() == "data:"):
            continue
        if not isinstance(uri, str) or not _inside(uri) or not _inside(unquote(uri)):
            problem = f"buffer {number} is outside of its folder ({shown(str(uri))})"
            raise TrajectoryError(path, problem, "export it as .glb, which is one file")
        found[number] = path.parent / unquote(uri)
        try:
            there = found[number].is_file()
        except ValueError:
            there = False
        if not there:
            problem = f"buffer {number}, {shown(unquote(uri))}, is not there"
            raise TrajectoryError(path, problem, "bring that file along, or export it as .glb, which is one file")
    return found


def _refuse_made_up(path: Path, document: dict[str, Any]) -> None:
    """Raise TrajectoryError for more numbers than are read: what no buffer holds is zeros, and may be any number."""
    accessors = document.get("accessors")
    counts = [one.get("count") for one in accessors if isinstance(one, dict)] if isinstance(accessors, list) else []
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
    return [one for one in part if isinstance(one, dict)] if isinstance(part, list) else []


def _depth(nodes: list[dict[str, Any]]) -> int:
    """How many nodes hang on one another at most; `DEEPEST` and one more where they hang on themselves."""
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


def _inside(uri: str) -> bool:
    """Whether a path stays in its folder, on whatever system."""
    if SCHEME.match(uri) or PurePosixPath(uri).is_absolute() or PureWindowsPath(uri).anchor:
        return False
    depth = 0
    for part in PureWindowsPath(uri).parts:
        depth += -1 if part == ".." else 1
        if depth < 0:
            return False
    return True


def _copy(
    folder: Path, document: dict[str, Any], binary: bytes | None, others: dict[int, Path]
) -> tuple[Path, np.ndarray]:
    """What Blender is to import, in a folder, and the times of keys in it that are in no track of the file."""
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
    return bytes_of_uri(uri) if uri[:5].lower() == "data:" else (folder / uri).read_bytes()


def _plain(part: Any) -> Any:
    """A part of the document without materials, extras, and extensions that do more than compress."""
    if isinstance(part, list):
        return [_plain(one) for one in part]
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
