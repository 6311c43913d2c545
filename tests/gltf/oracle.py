"""Where the nodes of a glTF file are, by matrices and the specification alone: nothing here is the program's own."""

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation

SIZES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

REST = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}


class File:
    """A file and what is in it."""

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

    def bytes_of(self, view: int) -> bytes:
        view = self.json["bufferViews"][view]
        first = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][first : first + view["byteLength"]]

    def numbers(self, accessor: int) -> np.ndarray:
        given = self.json["accessors"][accessor]
        kind, width = np.dtype(SIZES[given["componentType"]]), WIDTHS[given["type"]]
        result = np.zeros((given["count"], width), kind)
        if "bufferView" in given:
            data, first = self.bytes_of(given["bufferView"]), given.get("byteOffset", 0)
            step = self.json["bufferViews"][given["bufferView"]].get("byteStride", kind.itemsize * width)
            for row in range(given["count"]):
                result[row] = np.frombuffer(data, kind, width, first + row * step)
        if "sparse" in given:
            sparse = given["sparse"]
            places = np.frombuffer(
                self.bytes_of(sparse["indices"]["bufferView"]),
                SIZES[sparse["indices"]["componentType"]],
                sparse["count"],
            )
            values = np.frombuffer(self.bytes_of(sparse["values"]["bufferView"]), kind, sparse["count"] * width)
            result[places] = values.reshape(-1, width)
        return np.maximum(result / np.iinfo(kind).max, -1.0) if given.get("normalized") else result.astype(np.float64)

    def tracks(self, clip: int) -> dict[tuple[int, str], tuple[str, np.ndarray, np.ndarray]]:
        """Interpolation, times and values by node and path."""
        animation, result = self.json["animations"][clip], {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, values = self.numbers(sampler["input"])[:, 0], self.numbers(sampler["output"])
            result[channel["target"]["node"], channel["target"]["path"]] = (
                sampler.get("interpolation", "LINEAR"),
                times,
                values.reshape(len(times) * (3 if sampler.get("interpolation") == "CUBICSPLINE" else 1), -1),
            )
        return result

    def worlds(self, clip: int, times: np.ndarray) -> np.ndarray:
        """Matrices of all nodes, shape (nodes, times, 4, 4)."""
        nodes, tracks = self.json["nodes"], self.tracks(clip)
        parents = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
        result: dict[int, np.ndarray] = {}

        def world(node: int) -> np.ndarray:
            if node not in result:
                local = self._local(nodes[node], node, tracks, times)
                result[node] = world(parents[node]) @ local if node in parents else local
            return result[node]

        return np.array([world(node) for node in range(len(nodes))])

    def _local(self, node: dict[str, Any], number: int, tracks: Any, times: np.ndarray) -> np.ndarray:
        if "matrix" in node:
            return np.tile(np.reshape(node["matrix"], (4, 4)).T, (len(times), 1, 1))
        values = {
            path: shown(*tracks[number, path], times, path == "rotation")
            if (number, path) in tracks
            else np.tile(np.array(node.get(path, rest), dtype=np.float64), (len(times), 1))
            for path, rest in REST.items()
        }
        made = np.zeros((len(times), 4, 4))
        made[:, 3, 3] = 1.0
        made[:, :3, :3] = Rotation.from_quat(values["rotation"]).as_matrix()
        made[:, :3, :3] *= values["scale"][:, None]
        made[:, :3, 3] = values["translation"]
        return made

    def moments(self, clip: int) -> np.ndarray:
        return np.unique(np.concatenate([times for _, times, _ in self.tracks(clip).values()]))


def shown(interpolation: str, times: np.ndarray, values: np.ndarray, at: np.ndarray, turns: bool) -> np.ndarray:
    """By appendix C of the specification, one moment after the other."""
    rows = []
    for time in np.clip(at, times[0], times[-1]):
        key = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), max(len(times) - 2, 0))
        cubic = interpolation == "CUBICSPLINE"
        points = values[1::3] if cubic else values
        if len(times) == 1 or interpolation == "STEP":
            rows.append(points[-1 if time >= times[-1] else key])
            continue
        length = times[key + 1] - times[key]
        s = (time - times[key]) / length
        a, b = points[key], points[key + 1]
        if cubic:
            out, into = length * values[3 * key + 2], length * values[3 * key + 3]
            rows.append(
                (2 * s**3 - 3 * s**2 + 1) * a
                + (s**3 - 2 * s**2 + s) * out
                + (3 * s**2 - 2 * s**3) * b
                + (s**3 - s**2) * into
            )
        elif turns:
            a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
            b = -b if a @ b < 0.0 else b
            angle = 2.0 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))
            rows.append(a if angle < 1e-9 else (np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle))
        else:
            rows.append((1 - s) * a + s * b)
    return np.array(rows)


def off(before: File, after: File, clip: int, radius: float) -> float:
    """The largest displacement of any node or of points around it, at eighths of the densest keys of both files."""
    keys = np.union1d(before.moments(clip), after.moments(clip))
    times = np.append((keys[:-1, None] + np.diff(keys)[:, None] * np.arange(8) / 8).ravel(), keys[-1])
    truth, result = (file.worlds(clip, times) for file in (before, after))
    random = np.random.default_rng(5)
    ball = random.normal(size=(40, 3))
    ball = np.append(radius * ball / np.linalg.norm(ball, axis=1, keepdims=True), np.zeros((1, 3)), axis=0)
    largest = 0.0
    for node in range(len(truth)):
        axes = truth[node, :, :3, :3]
        sizes = np.linalg.norm(axes, axis=(1, 2))
        biggest = axes[np.argmax(sizes >= (1.0 - 1e-9) * sizes.max())]
        points = np.column_stack((ball @ np.linalg.pinv(biggest).T, np.ones(len(ball))))
        moved = (result[node] - truth[node]) @ points.T
        largest = max(largest, float(np.linalg.norm(moved[:, :3], axis=1).max()))
    return largest
