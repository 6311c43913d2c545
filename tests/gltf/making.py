"""Builder of glTF files with every animation feature, for tests."""

import base64
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

KINDS = {"f4": 5126, "i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125}

TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass
class Making:
    """A document under construction: the methods add parts and return their numbers."""

    json: dict[str, Any] = field(default_factory=dict)
    buffers: list[bytearray] = field(default_factory=lambda: [bytearray()])

    def __post_init__(self) -> None:
        begin = {
            "asset": {"version": "2.0", "extras": {"by": None}},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [],
        }
        self.json = begin | {"accessors": [], "bufferViews": [], "animations": []} | self.json

    def view(self, content: bytes, buffer: int = 0, **more: object) -> int:
        data = self.buffers[buffer]
        data += bytes(-len(data) % 4)
        view = {"buffer": buffer, "byteOffset": len(data), "byteLength": len(content)} | more
        data += content
        self.json["bufferViews"].append(view)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, numbers: np.ndarray, buffer: int = 0, **more: object) -> int:
        """Add an accessor with a view of its own."""
        numbers = numbers.reshape(len(numbers), -1)
        accessor = {"bufferView": self.view(numbers.tobytes(), buffer)} | self.described(numbers) | more
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def described(self, numbers: np.ndarray) -> dict[str, Any]:
        kind = KINDS[numbers.dtype.str[1:]]
        result = {"componentType": kind, "count": len(numbers), "type": TYPES[numbers.shape[1]]}
        if numbers.shape[1] == 1:
            result |= {"min": [float(numbers.min())], "max": [float(numbers.max())]}
        return result

    def times(self, times: Sequence[float] | np.ndarray, buffer: int = 0) -> int:
        return self.accessor(np.asarray(times, dtype="<f4"), buffer)

    def channel(
        self, node: int, path: str, times: int, values: int | np.ndarray, interpolation: str = "LINEAR", clip: int = 0
    ) -> None:
        """Add a channel to an animation; `values` is the number of an accessor, or the values for a new one."""
        while len(self.json["animations"]) <= clip:
            number = len(self.json["animations"])
            self.json["animations"].append({"name": f"Take{number}", "channels": [], "samplers": []})
        if isinstance(values, np.ndarray):
            values = self.accessor(values.astype("<f4") if values.dtype == np.float64 else values)
        animation = self.json["animations"][clip]
        animation["samplers"].append({"input": times, "output": values, "interpolation": interpolation})
        target = {"node": node, "path": path}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})

    def pointer(self, pointer: str, times: int, values: int | np.ndarray, *more: Any) -> None:
        """Add a channel that animates the target of a JSON pointer, like `channel`."""
        self.channel(0, "pointer", times, values, *more)
        extensions = {"KHR_animation_pointer": {"pointer": pointer}}
        clip = more[1] if len(more) > 1 else 0
        self.json["animations"][clip]["channels"][-1]["target"] = {"path": "pointer", "extensions": extensions}
        self.uses("KHR_animation_pointer")

    def uses(self, extension: str) -> None:
        """List an extension as used."""
        self.json["extensionsUsed"] = sorted({extension, *self.json.get("extensionsUsed", [])})

    def write(self, path: Path, chunks: Sequence[tuple[bytes, bytes]] = ()) -> Path:
        """Write the document as .glb, with more chunks at the end, or as .gltf with external buffers."""
        described = [{"byteLength": len(data)} for data in self.buffers]
        inside = path.suffix == ".glb"
        for number, (buffer, data) in enumerate(zip(described, self.buffers, strict=True)):
            if number == 1:
                buffer["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
            elif number or not inside:
                buffer["uri"] = f"{path.stem}%20{number}.bin"
                (path.parent / f"{path.stem} {number}.bin").write_bytes(data)
        text = json.dumps(self.json | {"buffers": described}).encode()
        path.write_bytes(glb(text, bytes(self.buffers[0]), chunks) if inside else text)
        return path


def glb(text: bytes, binary: bytes, chunks: Sequence[tuple[bytes, bytes]] = ()) -> bytes:
    """Return the bytes of a GLB."""
    parts = [(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", binary + bytes(-len(binary) % 4)), *chunks]
    content = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in parts)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(content)) + content


def turns(times: np.ndarray, seed: int, wide: float = 0.6) -> np.ndarray:
    """Return quaternions x, y, z, w of a smooth swing, shape (n, 4), float32."""
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    axis /= np.linalg.norm(axis)
    angles = wide * np.sin(random.uniform(2.0, 4.0) * times + random.uniform(0.0, 6.0))
    return np.column_stack((np.sin(angles / 2)[:, None] * axis, np.cos(angles / 2))).astype("<f4")


def walk(joints: int = 6, seconds: float = 2.0, unit: float = 1.0) -> Making:
    """Return a chain of swinging joints with a moving root and a skin, including constant channels."""
    made, times = Making(), np.arange(round(30 * seconds) + 1) / 30.0
    made.json["nodes"] = [
        {"name": f"Joint{joint}", "translation": [0.0, 0.3 * unit, 0.0], "children": [joint + 1]}
        for joint in range(joints)
    ]
    del made.json["nodes"][-1]["children"]
    inverse = np.tile(np.eye(4, dtype="<f4").ravel(), (joints, 1))
    made.json["skins"] = [{"joints": list(range(joints)), "inverseBindMatrices": made.accessor(inverse)}]
    own = made.times(times)
    places = np.column_stack((np.sin(times), 0.1 * np.sin(7.0 * times), times)) * unit
    made.channel(0, "translation", own, places)
    for joint in range(joints):
        made.channel(joint, "rotation", own, turns(times, joint))
        made.channel(joint, "scale", own, np.ones((len(times), 3)))
    return made
