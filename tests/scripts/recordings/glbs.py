"""GLB files of a chain of joints, written here, and where the glTF specification puts these joints: by matrices."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}

REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Track:
    """What moves a joint: `values` (n, 3) or (n, 4), quaternions x, y, z, w; of a cubic spline (3 n, ...)."""

    joint: int
    path: str
    times: np.ndarray
    values: np.ndarray
    interpolation: str = "LINEAR"

    def at(self, time: float) -> np.ndarray:
        """By the glTF specification, appendix C."""
        times, values, last = self.times, self.values, len(self.times) - 1
        cubic = self.interpolation == "CUBICSPLINE"
        points = values[1::3] if cubic else values
        time = np.clip(time, times[0], times[-1])
        key = min(int(np.searchsorted(times, time, side="right")) - 1, last - 1)
        length = times[key + 1] - times[key]
        s = (time - times[key]) / length
        if self.interpolation == "STEP":
            return points[last if time >= times[-1] else key]
        if cubic:
            out, into = length * values[3 * key + 2], length * values[3 * key + 3]
            made = (2 * s**3 - 3 * s**2 + 1) * points[key] + (s**3 - 2 * s**2 + s) * out
            made += (3 * s**2 - 2 * s**3) * points[key + 1] + (s**3 - s**2) * into
            return made / np.linalg.norm(made) if self.path == "rotation" else made
        a, b = points[key], points[key + 1]
        if self.path != "rotation":
            return (1 - s) * a + s * b
        angle = np.arccos(np.clip(abs(a @ b), 0.0, 1.0))
        if angle < 1e-9:
            return a
        return (np.sin((1 - s) * angle) * a + np.copysign(np.sin(s * angle), a @ b) * b) / np.sin(angle)


@dataclass(frozen=True, eq=False)
class Body:
    """Joints that hang on one another below a node of some scale."""

    parents: Sequence[int]
    offsets: np.ndarray
    tracks: Sequence[Track]
    size: float = 1.0
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def moments(self) -> np.ndarray:
        """The keys of all tracks, and eighths of the gaps between them."""
        keys = np.unique(np.concatenate([track.times for track in self.tracks]))
        return np.append((keys[:-1, None] + np.diff(keys)[:, None] * np.arange(8) / 8).ravel(), keys[-1])

    def places(self, times: np.ndarray) -> np.ndarray:
        """Where the joints are, shape (joints, times, 3), in Blender's axes."""
        found = np.empty((len(self.parents), len(times), 3))
        for number, time in enumerate(times):
            worlds: list[np.ndarray] = []
            for joint, parent in enumerate(self.parents):
                pose = REST | {"translation": self.offsets[joint]}
                pose |= {track.path: track.at(time) for track in self.tracks if track.joint == joint}
                above = np.diag([self.size] * 3 + [1.0]) if parent < 0 else worlds[parent]
                worlds.append(above @ matrix(**pose))
                x, y, z = worlds[-1][:3, 3]
                found[joint, number] = x, -z, y
        return found

    def write(self, path: Path) -> Path:
        """Write it as a GLB."""
        data, views, accessors = bytearray(), [], []

        def add(numbers: np.ndarray, kind: str) -> int:
            numbers = np.asarray(numbers, dtype="<f4")
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": numbers.nbytes})
            data.extend(numbers.tobytes())
            bounds = {"min": [float(numbers.min())], "max": [float(numbers.max())]} if kind == "SCALAR" else {}
            count = len(numbers)
            accessors.append(
                {"bufferView": len(views) - 1, "componentType": 5126, "count": count, "type": kind} | bounds
            )
            return len(accessors) - 1

        samplers = [
            {
                "input": add(track.times, "SCALAR"),
                "output": add(track.values, KINDS[track.path]),
                "interpolation": track.interpolation,
            }
            for track in self.tracks
        ]
        channels = [
            {"sampler": number, "target": {"node": track.joint, "path": track.path}}
            for number, track in enumerate(self.tracks)
        ]
        count = len(self.parents)
        nodes = [{"name": f"Joint{joint}", "translation": list(self.offsets[joint])} for joint in range(count)]
        nodes.append({"name": "Armature", "scale": [self.size] * 3})
        for joint, parent in enumerate(self.parents):
            nodes[parent if parent >= 0 else count].setdefault("children", []).append(joint)
        document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [count]}],
            "nodes": nodes,
            "skins": [{"joints": list(range(count))}],
            "animations": [{"name": "Take", "samplers": samplers, "channels": channels}],
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": len(data)}],
        } | self.settings
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + 8 + len(data)
        head = struct.pack("<4sII", b"glTF", 2, length) + struct.pack("<I4s", len(text), b"JSON")
        path.write_bytes(head + text + struct.pack("<I4s", len(data), b"BIN\0") + data)
        return path


def matrix(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    x, y, z, w = rotation
    made = np.eye(4)
    made[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    made[:3, :3] *= scale
    made[:3, 3] = translation
    return made


def turning(times: np.ndarray, angles: np.ndarray, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Quaternions x, y, z, w."""
    return np.column_stack((np.sin(angles / 2)[:, None] * np.asarray(axis), np.cos(angles / 2)))


def chain(count: int = 20, length: float = 0.09) -> tuple[list[int], np.ndarray]:
    """The parents and offsets of joints in a row."""
    offsets = np.tile((0.0, length, 0.0), (count, 1))
    offsets[0] = (0.0, 0.1, 0.0)
    return list(range(-1, count - 1)), offsets


def mixed_rates(seconds: float = 2.0) -> Body:
    """One joint keyed 30 times a second, which swings fast, and 19 others 5 times."""
    parents, offsets = chain()
    slow, fast = np.arange(round(5 * seconds) + 1) / 5, np.arange(round(30 * seconds) + 1) / 30
    tracks = [
        Track(joint, "rotation", slow, turning(slow, 0.1 * np.sin(2 * slow + joint), (1, 0, 0)))
        for joint in range(20)
        if joint != 3
    ]
    tracks.append(Track(3, "rotation", fast, turning(fast, 0.25 * np.sin(2 * np.pi * 5 * fast + 0.3))))
    return Body(parents, offsets, tracks)


def soldier(size: float = 0.01) -> Body:
    """A body of 1.8 m in a unit of its own below a node that scales it, as Mixamo exports them."""
    parents = [-1, 0, 1, 2, 3, 2, 5, 0, 7, 0, 9]
    offsets = np.array(
        [
            *((0, 95, 0), (0, 25, 0), (0, 25, 0), (0, 15, 0), (0, 18, 0), (50, 0, 0), (25, 0, 0)),
            *((10, -5, 0), (0, -85, 5), (-10, -5, 0), (0, -85, 5)),
        ]
    )
    times = np.arange(31) / 30
    tracks = [
        Track(joint, "rotation", times, turning(times, 0.3 * np.sin(3 * times + joint), (1, 0, 0)))
        for joint in range(len(parents))
    ]
    return Body(parents, offsets * 0.01 / size, tracks, size)


def curved(size: float = 1.0) -> Body:
    """Two keys a second, with tangents that are no ones that anybody would guess."""
    parents, offsets = chain(4, 0.4 / size)
    random, times = np.random.default_rng(4), np.array([0.0, 0.5, 1.1, 1.5, 2.0])
    tracks = []
    for joint in range(4):
        rows = np.zeros((5, 3, 4))
        rows[:, 1] = turning(times, 0.8 * np.sin(3 * times + joint), random.permutation(np.eye(3))[0])
        rows[:, [0, 2]] = random.normal(0.0, 0.8, (5, 2, 4))
        tracks.append(Track(joint, "rotation", times, rows.reshape(-1, 4), "CUBICSPLINE"))
    places = random.normal(0.0, 0.3 / size, (15, 3))
    return Body(parents, offsets, [*tracks, Track(0, "translation", times, places, "CUBICSPLINE")], size)
