"""Independent glTF player for tests: geometry at any moment, from matrices and the specification, without program code.

How to use it::

    before, after = File(path), File(reduced)
    after.points("Walk", times)                # Points by owner: {"mesh of node 3": (times, n, 3), ...}.
    error, what, time = off(before, after, 0)  # The largest world displacement, at eighths of the gaps between keys.

Clips are numbers or names. The points are the vertices of each primitive of each node of a scene (rigid, skinned,
morphed before that, instanced by EXT_mesh_gpu_instancing; without Draco compression), and the origin of each node. With
a radius, there are also points on a ball around each node in the node's own space, at that world distance along its
longest axis when that axis is longest: a node that shrinks shrinks its ball. KHR_animation_pointer moves nodes and
weights; its other targets are ignored. Anything without a track is at rest. Skins ignore the transform of their node,
and joint weights are normalised to a sum of 1.
"""

import base64
import json
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation

SIZES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

REST = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}

POINTER = re.compile(r"/(nodes|meshes)/(\d+)/(translation|rotation|scale|weights(?:/\d+)?)")

INSTANCES, DRACO = "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression"

BALL = 40
"""Points around a node."""

AT_ONCE = 2**20
"""Points times moments processed together."""

Track = tuple[str, np.ndarray, np.ndarray]
"""Interpolation, times (n,) and values (n or 3n, width)."""


class Off(NamedTuple):
    """The largest displacement, the name of the points, and the time."""

    error: float
    what: str
    time: float


class File:
    """A glTF file with its chunks, JSON and buffers."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        self.chunks: list[tuple[bytes, bytes]] = []
        if content[:4] == b"glTF":
            assert struct.unpack_from("<I", content, 8)[0] == len(content)
            place = 12
            while place < len(content):
                length, kind = struct.unpack_from("<I4s", content, place)
                self.chunks.append((kind, content[place + 8 : place + 8 + length]))
                place += 8 + length
            self.json: dict[str, Any] = json.loads(dict(self.chunks)[b"JSON"])
        else:
            self.json = json.loads(content)
        self.buffers = []
        for number, buffer in enumerate(self.json.get("buffers", [])):
            uri = buffer.get("uri")
            if uri is None:
                self.buffers.append(dict(self.chunks)[b"BIN\0"])
            elif uri.startswith("data:"):
                self.buffers.append(base64.b64decode(uri.partition(",")[2]))
            else:
                self.buffers.append((path.parent / unquote(uri)).read_bytes())
            assert len(self.buffers[number]) >= buffer["byteLength"]

    # Numbers

    def bytes_of(self, view: int) -> bytes:
        view = self.json["bufferViews"][view]
        first = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][first : first + view["byteLength"]]

    def stored(self, accessor: int) -> np.ndarray:
        """Return the stored numbers of an accessor, shape (count, width)."""
        given = self.json["accessors"][accessor]
        kind, width = np.dtype(SIZES[given["componentType"]]), WIDTHS[given["type"]]
        result = np.zeros((given["count"], width), kind)
        if "bufferView" in given:
            data, first = self.bytes_of(given["bufferView"]), given.get("byteOffset", 0)
            step = self.json["bufferViews"][given["bufferView"]].get("byteStride", kind.itemsize * width)
            result[:] = np.ndarray(result.shape, kind, data, first, (step, kind.itemsize))
        if "sparse" in given:
            sparse = given["sparse"]
            indices, values = sparse["indices"], sparse["values"]
            places = np.frombuffer(
                self.bytes_of(indices["bufferView"]),
                SIZES[indices["componentType"]],
                sparse["count"],
                indices.get("byteOffset", 0),
            )
            data, first = self.bytes_of(values["bufferView"]), values.get("byteOffset", 0)
            result[places] = np.frombuffer(data, kind, sparse["count"] * width, first).reshape(-1, width)
        return result

    def numbers(self, accessor: int) -> np.ndarray:
        """Return the decoded numbers of an accessor, shape (count, width)."""
        result, normalised = self.stored(accessor), self.json["accessors"][accessor].get("normalized")
        return np.maximum(result / np.iinfo(result.dtype).max, -1.0) if normalised else result.astype(np.float64)

    # Clips

    def clip(self, clip: int | str) -> int:
        """Return the number of a clip."""
        if isinstance(clip, int):
            return clip
        return [animation.get("name") for animation in self.json["animations"]].index(clip)

    def tracks(self, clip: int | str | None) -> dict[tuple[int, str], Track]:
        """Return tracks by node and path; meshes count as node -1 - mesh. There are none for the clip None, at rest."""
        if clip is None:
            return {}
        animation, result = self.json["animations"][self.clip(clip)], {}
        for channel in animation["channels"]:
            target, sampler = channel["target"], animation["samplers"][channel["sampler"]]
            if (key := moved_target(target)) is None:
                continue
            interpolation = sampler.get("interpolation", "LINEAR")
            times, values = self.numbers(sampler["input"])[:, 0], self.numbers(sampler["output"])
            rows = len(times) * (3 if interpolation == "CUBICSPLINE" else 1)
            assert key not in result
            result[key] = interpolation, times, values.reshape(rows, -1)
        return result

    def moments(self, clip: int | str) -> np.ndarray:
        """Return the times of all keys."""
        return np.unique(np.concatenate([times for _, times, _ in self.tracks(clip).values()] or [np.zeros(1)]))

    # Nodes

    def worlds(self, clip: int | str, times: np.ndarray) -> np.ndarray:
        """Return the world matrices of all nodes, shape (nodes, times, 4, 4)."""
        return worlds(self.json["nodes"], self.tracks(clip), times)

    def seen_nodes(self) -> list[int]:
        """Return the nodes in scenes; all nodes if there are no scenes."""
        nodes, result = self.json.get("nodes", []), []
        waiting = [node for scene in self.json.get("scenes", []) for node in scene.get("nodes", [])]
        while waiting:
            result.append(waiting.pop())
            waiting += nodes[result[-1]].get("children", [])
        return sorted(set(result)) if "scenes" in self.json else list(range(len(nodes)))

    # Geometry

    def points(self, clip: int | str, times: np.ndarray, around: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Return the world positions of all geometry by owner, shape (times, n, 3) each.

        `around` are additional points in the space of each node, shape (nodes, n, 3).
        """
        worlds, tracks = self.worlds(clip, times), self.tracks(clip)
        result = {}
        for number in self.seen_nodes():
            node = self.json["nodes"][number]
            result[f"node {number}"] = worlds[number, :, None, :3, 3]
            if around is not None:
                result[f"frame of node {number}"] = _applied(worlds[number], around[number])
            if "mesh" not in node:
                continue
            parts = [
                self._placed(node, places, primitive, worlds, worlds[number])
                for primitive, places in self._morphed(node, number, tracks, times)
            ]
            if parts:
                result[f"mesh of node {number}"] = np.concatenate(parts, axis=1)
        return result

    def around(self, clip: int | str, radius: float) -> np.ndarray:
        """Return points around each node, `radius` away where it is largest, in its space, shape (nodes, n, 3)."""
        worlds, random = self.worlds(clip, moments(self, clip=clip)), np.random.default_rng(5)
        ball = random.normal(size=(BALL, 3))
        ball = radius * ball / np.linalg.norm(ball, axis=1, keepdims=True)
        longest = np.linalg.norm(worlds[..., :3, :3], axis=-2).max(axis=(1, 2))
        return ball / np.where(longest > 0.0, longest, np.inf)[:, None, None]

    def has_meshes(self) -> bool:
        return any("mesh" in self.json["nodes"][node] for node in self.seen_nodes())

    def _morphed(
        self, node: dict[str, Any], number: int, tracks: dict[tuple[int, str], Track], times: np.ndarray
    ) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
        """Yield readable primitives with their vertices in the space of the mesh, shape (1 or times, n, 3)."""
        mesh = self.json["meshes"][node["mesh"]]
        for primitive in mesh["primitives"]:
            if "POSITION" not in primitive["attributes"] or DRACO in primitive.get("extensions", {}):
                continue
            places = self.numbers(primitive["attributes"]["POSITION"])[None]
            targets = primitive.get("targets", [])
            weights = _weights(node, number, mesh, len(targets), tracks, times)
            for weight, target in zip(weights.T, targets, strict=True):
                if "POSITION" in target:
                    places = places + weight[:, None, None] * self.numbers(target["POSITION"])
            yield primitive, places

    def _placed(
        self,
        node: dict[str, Any],
        places: np.ndarray,
        primitive: dict[str, Any],
        worlds: np.ndarray,
        world: np.ndarray,
    ) -> np.ndarray:
        """Return the world positions of vertices (1 or times, n, 3), shape (times, instances * n, 3)."""
        attributes = primitive["attributes"]
        if "skin" in node and "JOINTS_0" in attributes:
            skin = self.json["skins"][node["skin"]]
            maps = worlds[skin["joints"]]
            if "inverseBindMatrices" in skin:
                inverse = self.numbers(skin["inverseBindMatrices"])[: len(maps)].reshape(-1, 1, 4, 4)
                maps = maps @ np.swapaxes(inverse, -1, -2)
            sets = [number for number in range(len(attributes)) if f"JOINTS_{number}" in attributes]
            joints = np.hstack([self.numbers(attributes[f"JOINTS_{number}"]) for number in sets]).astype(int)
            shares = np.hstack([self.numbers(attributes[f"WEIGHTS_{number}"]) for number in sets])
            shares[~shares.any(axis=1), 0] = 1.0
            shares /= shares.sum(axis=1, keepdims=True)
            moved = (np.moveaxis(maps[own], 0, 1) for own in joints.T)
            return sum(share[:, None] * _each_applied(own, places) for own, share in zip(moved, shares.T, strict=True))
        if INSTANCES not in node.get("extensions", {}):
            return _applied(world, places)
        given = {path: self.numbers(own) for path, own in node["extensions"][INSTANCES]["attributes"].items()}
        count = len(next(iter(given.values())))
        named = [(name, given.get(name.upper(), np.tile(rest, (count, 1)))) for name, rest in REST.items()]
        return np.concatenate([_applied(world @ own, places) for own in composed(**dict(named))], axis=1)


def worlds(nodes: list[dict[str, Any]], tracks: dict[tuple[int, str], Track], times: np.ndarray) -> np.ndarray:
    """Return the world matrices of nodes that tracks move, shape (nodes, times, 4, 4)."""
    parents = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
    result: dict[int, np.ndarray] = {}

    def world(node: int) -> np.ndarray:
        if node not in result:
            local = _local(nodes[node], node, tracks, times)
            result[node] = world(parents[node]) @ local if node in parents else local
        return result[node]

    return np.array([world(node) for node in range(len(nodes))])


def moments(*files: File, clip: int | str) -> np.ndarray:
    """Return all keys of these files in a clip, and eighths of the gaps between them."""
    return eighths(np.unique(np.concatenate([file.moments(clip) for file in files])))


def eighths(keys: np.ndarray) -> np.ndarray:
    """Return rising times and eighths of their gaps, except for gaps of one single-precision step, which are cuts."""
    gaps = np.diff(keys)[:, None]
    between = (
        keys[:-1, None] + np.where(gaps > 1.5 * np.spacing(np.float32(keys[:-1, None])), gaps, 0.0) * np.arange(8) / 8
    )
    return np.unique(np.append(between, keys[-1]))


def off(before: File, after: File, clip: int | str, radius: float = 0.0, times: np.ndarray | None = None) -> Off:
    """Return the largest displacement at times or at `moments`; with a radius also of points around each node."""
    times = moments(before, after, clip=clip) if times is None else times
    around = before.around(clip, radius) if radius else None
    count = sum(map(np.size, before.points(clip, times[:1], around).values()))
    largest = Off(0.0, "nothing", float(times[0]))
    for own in np.array_split(times, min(len(times), 1 + len(times) * count // AT_ONCE)):
        truth, result = (file.points(clip, own, around) for file in (before, after))
        assert truth.keys() == result.keys()
        for what, places in truth.items():
            errors = np.linalg.norm(result[what] - places, axis=-1).max(axis=1, initial=0.0)
            worst = int(np.argmax(errors))
            if errors[worst] > largest.error:
                largest = Off(float(errors[worst]), what, float(own[worst]))
    return largest


def shown(interpolation: str, times: np.ndarray, values: np.ndarray, at: np.ndarray, turns: bool) -> np.ndarray:
    """Return the values of a track, by appendix C of the specification."""
    cubic = interpolation == "CUBICSPLINE"
    points, at = values[1::3] if cubic else values, np.clip(at, times[0], times[-1])
    keys = np.searchsorted(times, at, side="right") - 1
    if len(times) == 1 or interpolation == "STEP":
        return points[keys]
    keys = np.minimum(keys, len(times) - 2)
    length = (times[keys + 1] - times[keys])[:, None]
    s = np.divide((at - times[keys])[:, None], length, out=np.ones_like(length), where=length > 0.0)
    a, b = points[keys], points[keys + 1]
    if cubic:
        out, into = length * values[2::3][keys], length * values[0::3][keys + 1]
        return (
            (2 * s**3 - 3 * s**2 + 1) * a
            + (s**3 - 2 * s**2 + s) * out
            + (3 * s**2 - 2 * s**3) * b
            + (s**3 - s**2) * into
        )
    if not turns:
        return (1 - s) * a + s * b
    a, b = (part / np.linalg.norm(part, axis=1, keepdims=True) for part in (a, b))
    b = np.where(np.sum(a * b, axis=1, keepdims=True) < 0.0, -b, b)
    between = Rotation.from_quat(a).inv() * Rotation.from_quat(b)
    return (Rotation.from_quat(a) * Rotation.from_rotvec(s * between.as_rotvec())).as_quat()


def composed(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the matrices of n transforms, shape (n, 4, 4)."""
    made = np.zeros((len(translation), 4, 4))
    made[:, 3, 3] = 1.0
    made[:, :3, :3] = Rotation.from_quat(rotation).as_matrix() * np.asarray(scale)[:, None]
    made[:, :3, 3] = translation
    return made


def _local(node: dict[str, Any], number: int, tracks: dict[tuple[int, str], Track], times: np.ndarray) -> np.ndarray:
    if "matrix" in node:
        return np.tile(np.reshape(node["matrix"], (4, 4)).T, (len(times), 1, 1))
    values = {
        path: shown(*tracks[number, path], times, path == "rotation")
        if (number, path) in tracks
        else np.tile(np.array(node.get(path, rest), dtype=np.float64), (len(times), 1))
        for path, rest in REST.items()
    }
    return composed(**values)


def moved_target(target: dict[str, Any]) -> tuple[int, str] | None:
    """Return the node, or -1 - mesh, and the path that a channel moves; None for other targets."""
    if target["path"] != "pointer":
        return (target["node"], target["path"]) if "node" in target else None
    match = POINTER.fullmatch(target["extensions"]["KHR_animation_pointer"]["pointer"])
    if not match:
        return None
    kind, number, path = match.groups()
    return (int(number) if kind == "nodes" else -1 - int(number)), path


def _weights(
    node: dict[str, Any],
    number: int,
    mesh: dict[str, Any],
    count: int,
    tracks: dict[tuple[int, str], Track],
    times: np.ndarray,
) -> np.ndarray:
    """Return the weights of morph targets, shape (times, count)."""
    owner = number if (number, "weights") in tracks or "weights" in node else -1 - node["mesh"]
    rest = node.get("weights", mesh.get("weights", np.zeros(count)))
    if (owner, "weights") in tracks:
        return shown(*tracks[owner, "weights"], times, False)
    result = np.tile(np.array(rest, dtype=np.float64), (len(times), 1))
    for place in range(count):
        for one in (-1 - node["mesh"], number):
            if (one, f"weights/{place}") in tracks and not (one < 0 and "weights" in node):
                result[:, place] = shown(*tracks[one, f"weights/{place}"], times, False)[:, 0]
    return result


def _applied(maps: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return points (n, 3) or (times, n, 3) transformed by matrices (times, 4, 4), shape (times, n, 3)."""
    return places @ np.swapaxes(maps[:, :3, :3], 1, 2) + maps[:, None, :3, 3]


def _each_applied(maps: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return points (1 or times, n, 3), each transformed by its own matrix (times, n, 4, 4), shape (times, n, 3)."""
    return (maps[..., :3, :3] @ places[..., None])[..., 0] + maps[..., :3, 3]
