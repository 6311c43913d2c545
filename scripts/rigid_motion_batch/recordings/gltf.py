"""glTF and GLB files by Blender's own importer: the whole skeleton as Blender shows it.

The importer gets a copy of what makes a skeleton and its skin, in a folder that is gone afterwards: no images, nor
what extensions and extras say, and buffers only from the folder of the file. Key times are seconds; a skeleton is
sampled as often as the keys of its densest track come, or 60 times a second where they tell no rate.
Source: the glTF 2.0 specification, Khronos 2021.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigid_motion.gltf.documents import FileBytes, GltfError, Json, objects, read_document

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
    try:
        document = read_document(path)
        beside = {buffer.path for buffer in document.buffers if isinstance(buffer, FileBytes)} - {path}
        refuse_too_large(path, *beside)
        _refuse_too_many(path, document.json)
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
        return read_imported(path, selection, lambda: _import(importer), ADDON, _rate, options.scale, FPS, made * FPS)


def _rate(_: float, keys: float | None) -> float:
    return keys or WITHOUT_A_RATE


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
    if _depth(nodes) > DEEPEST:
        problem = f"more than {DEEPEST} nodes hang on one another"
        raise TrajectoryError(path, problem, "export a shorter chain")


def _depth(nodes: list[Json]) -> int:
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
