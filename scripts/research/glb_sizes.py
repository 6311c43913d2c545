"""Animations of GLB files made smaller: reduce, gltf-transform and gltfpack side by side.

    python scripts/research glb_sizes walk.fbx run.bvh --tools FOLDER

`--tools` is the folder with the programs `gltfpack` and `gltf-transform`, as `npm install gltfpack
@gltf-transform/cli` puts them into `node_modules/.bin`; each that is missing is left out. The reader and the player
here share nothing with the program; they need SciPy.
"""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from research.publishing import publish, say, study_parser
from rigid_motion.gltf import Options, reduce_file
from rigid_motion_batch.analysis.metrics import geometric_mean

HEIGHT = 1.7
RADIUS = 0.03
"""Metres."""

TOLERANCES = (1e-4, 1e-3, 5e-3)
"""Metres."""

TOOLS = {
    "gltf-transform `resample`": ("gltf-transform", "resample", "{0}", "{1}"),
    "gltfpack `-noq`": ("gltfpack", "-i", "{0}", "-o", "{1}", "-kn", "-noq"),
    "gltfpack, its defaults": ("gltfpack", "-i", "{0}", "-o", "{1}", "-kn"),
}
"""Programs beside, with the arguments that make one file another."""

NUMBERS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, eq=False)
class Track:
    """One channel: times of shape (k,), values of shape (k, 3 or 4), linear between them, or held."""

    node: int
    path: str
    times: np.ndarray
    values: np.ndarray
    steps: bool


@dataclass(frozen=True, eq=False)
class File:
    """What is played of a file: nodes by name, and the tracks of its longest clip."""

    names: list[str]
    parents: list[int]
    rest: list[dict[str, np.ndarray]]
    tracks: list[Track]
    animation_bytes: int
    """Of the accessors of all clips."""

    file_bytes: int


def read(path: Path) -> File:
    """Read a GLB with one buffer, no sparse accessor and no other interpolation than LINEAR and STEP."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + length]), data[20 + length + 8 :]

    def values(number: int) -> np.ndarray:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype(NUMBERS[accessor["componentType"]]), SIZES[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        step = view.get("byteStride", kind.itemsize * width)
        result = np.ndarray((accessor["count"], width), kind, binary, start, (step, kind.itemsize))
        if not accessor.get("normalized"):
            return result.astype(float)
        return np.maximum(result / float(np.iinfo(kind).max), -1.0)

    nodes = document["nodes"]
    parents = [-1] * len(nodes)
    for number, node in enumerate(nodes):
        for child in node.get("children", ()):
            parents[child] = number
    clips = []
    accessors = set()
    for animation in document.get("animations", ()):
        tracks = []
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            accessors |= {sampler["input"], sampler["output"]}
            times, keys = values(sampler["input"])[:, 0], values(sampler["output"])
            steps = sampler.get("interpolation", "LINEAR") == "STEP"
            tracks.append(Track(channel["target"]["node"], channel["target"]["path"], times, keys, steps))
        clips.append(tracks)

    def size(number: int) -> int:
        accessor = document["accessors"][number]
        return accessor["count"] * SIZES[accessor["type"]] * np.dtype(NUMBERS[accessor["componentType"]]).itemsize

    rest = [
        {
            "translation": np.array(node.get("translation", (0.0, 0.0, 0.0))),
            "rotation": np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0))),
            "scale": np.array(node.get("scale", (1.0, 1.0, 1.0))),
        }
        for node in nodes
    ]
    longest = max(clips, key=len)
    names = [node.get("name", f"node {number}") for number, node in enumerate(nodes)]
    return File(names, parents, rest, longest, sum(map(size, accessors)), len(data))


def points(file: File, at: np.ndarray) -> dict[str, np.ndarray]:
    """Return where each node's head and points beside it are in the world: name to shape (moments, 7, 3)."""
    channels = {(track.node, track.path): track for track in file.tracks}
    worlds: dict[int, np.ndarray] = {}

    def values(node: int, path: str) -> np.ndarray:
        track = channels.get((node, path))
        if track is None or len(track.times) == 1:
            return np.repeat(file.rest[node][path][None] if track is None else track.values, len(at), axis=0)
        if track.steps:
            return track.values[np.clip(np.searchsorted(track.times, at, side="right") - 1, 0, None)]
        if path == "rotation":
            return Slerp(track.times, Rotation.from_quat(track.values))(at.clip(*track.times[[0, -1]])).as_quat()
        return np.stack([np.interp(at, track.times, column) for column in track.values.T], axis=1)

    def world(node: int) -> np.ndarray:
        if node not in worlds:
            own = np.tile(np.eye(4), (len(at), 1, 1))
            own[:, :3, :3] = Rotation.from_quat(values(node, "rotation")).as_matrix() * values(node, "scale")[:, None]
            own[:, :3, 3] = values(node, "translation")
            worlds[node] = own if file.parents[node] < 0 else world(file.parents[node]) @ own
        return worlds[node]

    result = {}
    for node, name in enumerate(file.names):
        matrix = world(node)
        axes = np.swapaxes(matrix[:, :3, :3], 1, 2)
        axes = RADIUS * axes / np.linalg.norm(axes, axis=2, keepdims=True)
        head = matrix[:, None, :3, 3]
        result[name] = np.concatenate((head, head + axes, head - axes), axis=1)
    return result


def beside(original: File, smaller: File, tool: str) -> dict[str, Any]:
    """Return what a tool made of a clip, with its errors at eighths of the gaps between the keys of both files."""
    times = np.unique(np.concatenate([track.times for file in (original, smaller) for track in file.tracks]))
    eighths = np.unique((times[:-1, None] + np.diff(times)[:, None] * np.arange(8) / 8.0).ravel())
    one, other = points(original, eighths), points(smaller, eighths)
    errors = np.array([np.linalg.norm(one[name] - other[name], axis=2).max(axis=1) for name in one if name in other])
    return {
        "tool": tool,
        "animation_bytes": smaller.animation_bytes,
        "share": smaller.animation_bytes / original.animation_bytes,
        "file_bytes": smaller.file_bytes,
        "error_mm": 1e3 * errors.max(),
        "within_tenth": (errors <= 1e-4).mean(),
        "within_one": (errors <= 1e-3).mean(),
    }


def export(path: Path, output: Path) -> None:
    """Import a body with Blender, scale it to `HEIGHT`, and export it with a key on every frame."""

    def load(scale: float) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        if path.suffix.lower() == ".fbx":
            bpy.ops.import_scene.fbx(filepath=str(path), global_scale=scale)
        else:
            options = {"use_fps_scale": False, "update_scene_fps": True, "update_scene_duration": True}
            bpy.ops.import_anim.bvh(filepath=str(path), global_scale=scale, **options)

    load(1.0)
    rig = next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    heads = np.array([rig.matrix_world @ bone.head_local for bone in rig.data.bones])
    load(HEIGHT / float(np.ptp(heads, axis=0).max()))
    ends = [frame for action in bpy.data.actions for frame in action.frame_range]
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = int(min(ends)), int(max(ends))
    bpy.ops.export_scene.gltf(filepath=str(output), export_format="GLB")


def measure(path: Path, tools: Path | None, folder: Path) -> list[dict[str, Any]]:
    """Return what the exporter and each tool make of a body."""
    exported, output = folder / f"{path.stem}.glb", folder / f"{path.stem}-smaller.glb"
    export(path, exported)
    original = read(exported)
    result = [beside(original, original, "exported by Blender")]
    for tolerance in TOLERANCES:
        reduce_file(exported, output, Options(tolerance, RADIUS))
        result.append(beside(original, read(output), f"`reduce --tolerance {1e3 * tolerance:g}mm`"))
    for name, (program, *given) in TOOLS.items():
        if tools and (program := shutil.which(program, path=str(tools))):
            arguments = [one.format(exported, output) for one in given]
            subprocess.run([program, *arguments], check=True, capture_output=True)
            result.append(beside(original, read(output), name))
    return result


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("glb_sizes", __doc__)
    parser.add_argument("bodies", type=Path, nargs="+", metavar="PATH", help="FBX and BVH files")
    parser.add_argument("--tools", type=Path, metavar="FOLDER", help="where gltfpack and gltf-transform are")
    options = parser.parse_args(arguments)
    clips = []
    with tempfile.TemporaryDirectory() as folder:
        for path in options.bodies:
            say(path.name)
            clips.append({"name": path.stem, "tools": measure(path, options.tools, Path(folder))})
    shares = {one["tool"]: [] for one in clips[0]["tools"]}
    for clip in clips:
        for one in clip["tools"]:
            shares[one["tool"]].append(one["share"])
    figures = {"clips": clips, "means": {tool: geometric_mean(np.array(result)) for tool, result in shares.items()}}
    given = f"...{' --tools ...' if options.tools else ''}"
    return publish("benchmark_glb", figures, options, given, Blender=bpy.app.version_string)
