"""Measurements for the GLB benchmark: bytes of animations, and errors of playback, independent of the program.

Files are played with matrices; compressed files are first decoded by npm's `meshoptimizer`. Lengths are in the unit of
the file.
"""

from __future__ import annotations

import json
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from tests.gltf.player import File, Track, eighths

DECODE = """
import { NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { MeshoptDecoder } from "meshoptimizer";
await MeshoptDecoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({ "meshopt.decoder": MeshoptDecoder });
const document = await io.read(process.argv[1]);
for (const extension of document.getRoot().listExtensionsUsed())
  if (extension.extensionName.includes("meshopt")) extension.dispose();
await io.write(process.argv[2], document);
"""
"""A Node script that writes a file without compression."""

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def json_of(path: Path) -> dict[str, Any]:
    """Return the JSON of a GLB."""
    content = path.read_bytes()
    return json.loads(content[20 : 20 + struct.unpack_from("<I", content, 12)[0]])


def animation_bytes(path: Path) -> int:
    """Return the stored bytes of all keys of a file: times and values.

    Compressed views count once, even if keys share them; in uncompressed views, only the bytes of the keys count.
    """
    document, total, views = json_of(path), 0, set[int]()
    samplers = [sampler for animation in document["animations"] for sampler in animation["samplers"]]
    for accessor in {sampler[side] for sampler in samplers for side in ("input", "output")}:
        given = document["accessors"][accessor]
        view = document["bufferViews"][given["bufferView"]]
        packed = next((view["extensions"][name] for name in MESHOPT if name in view.get("extensions", {})), None)
        if packed is None:
            size = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5126: 4}[given["componentType"]]
            total += size * {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[given["type"]] * given["count"]
        elif given["bufferView"] not in views:
            views.add(given["bufferView"])
            total += packed["byteLength"]
    return total


def opened(path: Path, tools: Path | None) -> Played:
    """Return a file ready for playback, decompressed if needed."""
    if not {*MESHOPT} & {*json_of(path).get("extensionsUsed", ())}:
        return Played(path)
    assert tools is not None
    plain = path.with_suffix(".plain.glb")
    # glTF-Transform knows the older name, and the decoder both kinds of streams.
    plain.write_bytes(path.read_bytes().replace(MESHOPT[1].encode(), MESHOPT[0].encode()))
    command = ["node", "--input-type=module", "--eval", DECODE, plain.absolute(), plain.absolute()]
    subprocess.run(command, check=True, capture_output=True, cwd=tools.parent.parent)
    return Played(plain)


class Played(File):
    """A file that computes skins with one matrix product, and caches the world matrices."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.known: dict[tuple[object, bytes], np.ndarray] = {}

    def worlds(self, clip: int | str | None, times: np.ndarray) -> np.ndarray:
        """Return the world matrices of all nodes, shape (nodes, times, 4, 4)."""
        key = clip, times.tobytes()
        if key not in self.known:
            self.known[key] = super().worlds(clip, times)
        return self.known[key]

    def _placed(
        self, node: dict[str, Any], places: np.ndarray, primitive: dict[str, Any], worlds: np.ndarray, world: np.ndarray
    ) -> np.ndarray:
        attributes = primitive["attributes"]
        if "skin" not in node or "JOINTS_0" not in attributes:
            return super()._placed(node, places, primitive, worlds, world)
        skin = self.json["skins"][node["skin"]]
        maps = worlds[skin["joints"]]
        if "inverseBindMatrices" in skin:
            inverse = self.numbers(skin["inverseBindMatrices"])[: len(maps)].reshape(-1, 1, 4, 4)
            maps = maps @ np.swapaxes(inverse, -1, -2)
        weights = np.zeros((places.shape[1], len(maps)))
        for number in (number for number in range(len(attributes)) if f"JOINTS_{number}" in attributes):
            of = self.numbers(attributes[f"JOINTS_{number}"]).astype(int)
            np.add.at(weights, (np.arange(len(of))[:, None], of), self.numbers(attributes[f"WEIGHTS_{number}"]))
        weights /= weights.sum(axis=1, keepdims=True)
        blended = (weights @ maps[..., :3, :].reshape(len(maps), -1)).reshape(len(weights), -1, 3, 4).swapaxes(0, 1)
        return (blended[..., :3] @ places[..., None])[..., 0] + blended[..., 3]


class Beside(Played):
    """The meshes of one file, moved by the nodes of another file with the same names."""

    def __init__(self, file: Played, other: Played) -> None:
        self.__dict__ |= vars(file)
        self.file, self.other = file, other
        numbers = {node.get("name"): number for number, node in enumerate(other.json["nodes"])}
        self.theirs = [numbers.get(node.get("name")) for node in file.json["nodes"]]

    def clip_of_other(self, clip: int | str | None) -> str | None:
        names = {animation.get("name") for animation in self.other.json["animations"]}
        return clip if isinstance(clip, str) and clip in names else None

    def worlds(self, clip: int | str | None, times: np.ndarray) -> np.ndarray:
        """Return world matrices of nodes, shape (nodes, times, 4, 4); nodes missing in the other file keep theirs."""
        result = self.file.worlds(clip, times).copy()
        theirs = self.other.worlds(self.clip_of_other(clip), times)
        for number, other in enumerate(self.theirs):
            if other is not None:
                result[number] = theirs[other]
        return result

    def tracks(self, clip: int | str | None) -> dict[tuple[int, str], Track]:
        """Return the tracks; morph targets take the other file's track for the same node, or else its only one."""
        result = super().tracks(clip)
        theirs = self.other.tracks(self.clip_of_other(clip))
        weights = {node: track for (node, path), track in theirs.items() if path == "weights"}
        for node, path in result:
            if path == "weights":
                result[node, path] = weights.get(self.theirs[node]) or next(iter(weights.values()), result[node, path])
        return result


def size_of(file: File) -> float:
    """Return the largest extent along any axis of a file's joints, or else nodes, in the rest pose."""
    rested = [joint for skin in file.json.get("skins", []) for joint in skin["joints"]] or [
        *range(len(file.json["nodes"]))
    ]
    return float(np.ptp(file.worlds(None, np.zeros(1))[rested, 0, :3, 3], axis=0).max())


def joints(file: File, clip: str, times: np.ndarray, radius: float) -> np.ndarray:
    """Return world positions of named nodes' heads and six points around each, shape (nodes, times, 7, 3)."""
    named = [number for number, node in enumerate(file.json["nodes"]) if "name" in node]
    worlds = file.worlds(clip, times)[named]
    axes = np.swapaxes(worlds[..., :3, :3], -1, -2)
    axes = radius * axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    heads = worlds[..., None, :3, 3]
    return np.concatenate((heads, heads + axes, heads - axes), axis=-2)


def vertices(file: File, clip: str, times: np.ndarray) -> np.ndarray:
    """Return world positions of all vertices, shape (times, vertices, 3)."""
    seen = [points for what, points in file.points(clip, times).items() if what.startswith("mesh")]
    return np.concatenate(seen, axis=1) if seen else np.zeros((len(times), 0, 3))


AT_ONCE = 400
"""The number of moments evaluated together."""


def errors_of(original: Played, smaller: Played, radius: float, enough: float = np.inf) -> dict[str, float | None]:
    """Return the largest displacements of joints and points at `radius` from them, and of vertices (None without any).

    The first two are evaluated at eighths of the gaps between the keys of both files; "at_frames" is both at the
    original's keys. The evaluation stops once a displacement exceeds `enough`.
    """
    largest = {"joints": 0.0, "vertices": 0.0, "at_frames": 0.0}
    beside = Beside(original, smaller)
    for animation in original.json["animations"]:
        clip = animation["name"]
        kept, frames = beside.clip_of_other(clip), original.moments(clip)
        times = eighths(np.union1d(frames, smaller.moments(kept) if kept else frames))
        for some in np.array_split(times, 1 + len(times) // AT_ONCE):
            off = np.linalg.norm(joints(beside, clip, some, radius) - joints(original, clip, some, radius), axis=-1)
            moved = np.linalg.norm(vertices(beside, clip, some) - vertices(original, clip, some), axis=-1)
            every = np.maximum(off.max(axis=(0, 2)), moved.max(axis=1, initial=0.0))
            is_frame = np.isin(some, frames)
            for name, error in (("joints", off), ("vertices", moved), ("at_frames", every[is_frame])):
                largest[name] = max(largest[name], float(error.max(initial=0.0)))
            if max(largest.values()) > enough:
                return largest
    return largest if original.has_meshes() else largest | {"vertices": None}
