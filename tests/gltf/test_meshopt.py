"""What meshopt compressed is read as its own library would have it."""

import base64
import ctypes
import json
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.gltf import Options, reduced
from rigid_motion.gltf.accessors import numbers
from rigid_motion.gltf.documents import Document, GltfError, read_document
from rigid_motion.gltf.meshopt import decompressed
from rigid_motion_batch.recordings import read_trajectories
from tests.gltf.making import Making, turns, walk

PLACE = Path(spec.origin).parent / "lib" / "libmeshoptimizer.so" if (spec := find_spec("bpy")) else Path()
LIBRARY = ctypes.CDLL(str(PLACE)) if PLACE.is_file() else None
"""That of the Blender module, from Blender 5.2 on."""


def encodings(elements: np.ndarray) -> Iterator[bytes]:
    """What the library makes of elements (count, stride) of bytes, and what is made of them here."""
    yield encoded(elements)
    if LIBRARY:
        LIBRARY.meshopt_encodeVertexBufferBound.restype = LIBRARY.meshopt_encodeVertexBuffer.restype = ctypes.c_size_t
        LIBRARY.meshopt_encodeVertexVersion(0)
        shape, content = tuple(map(ctypes.c_size_t, elements.shape)), np.ascontiguousarray(elements)
        size = LIBRARY.meshopt_encodeVertexBufferBound(*shape)
        result = ctypes.create_string_buffer(size)
        place = content.ctypes.data_as(ctypes.c_void_p)
        length = LIBRARY.meshopt_encodeVertexBuffer(result, ctypes.c_size_t(size), place, *shape)
        assert length
        yield result.raw[:length]


def encoded(elements: np.ndarray) -> bytes:
    """The same with the narrowest way for each group."""
    count, stride = elements.shape
    most, result = min(8192 // stride // 16 * 16, 256), bytearray(b"\xa0")
    steps = np.diff(elements, axis=0, prepend=elements[:1]).view(np.int8)
    signed = (steps.astype(np.int16) << 1 ^ (steps >> 7)).astype(np.uint8)
    for first in range(0, count, most):
        block = signed[first : first + most]
        block = np.concatenate([block, np.zeros((-len(block) % 16, stride), dtype=np.uint8)])
        for column in block.T:
            kinds, groups = [], []
            for group in column.reshape(-1, 16):
                ways = [b"" if not group.any() else bytes(99), packed(group, 1), packed(group, 2), group.tobytes()]
                kinds.append(min(range(4), key=lambda way: len(ways[way])))
                groups.append(ways[kinds[-1]])
            kinds += [0] * (-len(kinds) % 4)
            result += bytes(
                sum(kind << 2 * place for place, kind in enumerate(kinds[four : four + 4]))
                for four in range(0, len(kinds), 4)
            )
            result += b"".join(groups)
    return bytes(result) + bytes(max(32 - stride, 0)) + elements[0].tobytes()


def packed(group: np.ndarray, kind: int) -> bytes:
    """A group in parts of bytes of 2 or 4 bits, and whole ones where these do not do."""
    widest, each = 4**kind - 1, 4 // kind
    parts = np.minimum(group, widest).reshape(-1, each)
    shifts = 2 * kind * np.arange(each - 1, -1, -1)
    return bytes((parts << shifts).sum(axis=1).tolist()) + group[group >= widest].tobytes()


def document(data: bytes, count: int, stride: int, **more: object) -> Document:
    own = {"buffer": 0, "byteLength": len(data), "byteStride": stride, "count": count, "mode": "ATTRIBUTES", **more}
    view = {"buffer": 1, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": own}}
    return Document({"buffers": [{"byteLength": len(data)}, {}], "bufferViews": [view]}, (data, None))


@pytest.mark.parametrize("count", [1, 16, 17, 257, 1000])
@pytest.mark.parametrize("stride", [4, 12, 64, 256])
@pytest.mark.parametrize("wide", [0, 1, 40, 255])
def test_elements_come_back_as_they_were(count: int, stride: int, wide: int) -> None:
    random = np.random.default_rng(count + stride + wide)
    steps = random.integers(-wide, wide + 1, (count, stride)) * (random.random((count, stride)) < 0.3)
    elements = np.cumsum(steps, axis=0).astype(np.uint8)
    for data in encodings(elements):
        result = decompressed(document(data, count, stride))
        assert result.buffers[-1][: count * stride] == elements.tobytes()
        assert result.json["bufferViews"] == [{"buffer": 2, "byteOffset": 0, "byteLength": count * stride}]


@pytest.mark.parametrize(
    ("name", "stride", "elements", "kind", "values"),
    [
        (
            "QUATERNION",
            8,
            "825a825a825afc7f7ea57ea5e6edfd7f000000000000ff7f921249c82525fc7f",
            "<i2",
            [16383, 16384, 16384, 16384, -3277, 22937, -16384, -16384, 0, 0, 0, 32767, 30256, 3362, -10085, 6724],
        ),
        (
            "EXPONENTIAL",
            12,
            "002000f300e0fff1ea3e00e3883e00fc000000f200c8fff5",
            "<f4",
            [1.0, -0.25, 2.9999762773513794e-05, 1000.5, 0.0, -7.0],
        ),
    ],
)
def test_filters_are_undone_as_by_the_library(name: str, stride: int, elements: str, kind: str, values: list) -> None:
    given = np.frombuffer(bytes.fromhex(elements), np.uint8).reshape(-1, stride)
    data = encoded(given)
    made = decompressed(document(data, len(given), stride, filter=name)).buffers[-1]
    assert np.frombuffer(made, kind).tolist() == values


def compressed(made: Making, path: Path) -> Path:
    """A file of the same, every view of which is compressed."""
    plain = read_document(made.write(path))
    parts, views = [], []
    for view in plain.json["bufferViews"]:
        content = bytes(plain.buffers[view["buffer"]][view["byteOffset"] : view["byteOffset"] + view["byteLength"]])
        accessor = next(it for it in plain.json["accessors"] if it["bufferView"] == len(views))
        data = encoded(np.frombuffer(content, np.uint8).reshape(accessor["count"], -1))
        own = {"buffer": 0, "byteOffset": sum(map(len, parts)), "byteLength": len(data), "count": accessor["count"]}
        own |= {"byteStride": len(content) // accessor["count"], "mode": "ATTRIBUTES"}
        views.append({"buffer": 1, "byteLength": len(content), "extensions": {"EXT_meshopt_compression": own}})
        parts.append(data)
    uri = f"data:application/octet-stream;base64,{base64.b64encode(b''.join(parts)).decode()}"
    buffers = [{"byteLength": sum(map(len, parts)), "uri": uri}, {"byteLength": 1, "extensions": {}}]
    result = path.with_name("compressed.gltf")
    result.write_text(json.dumps(plain.json | {"bufferViews": views, "buffers": buffers}))
    return result


def test_a_recording_that_is_compressed_is_read_like_the_plain_one(tmp_path: Path) -> None:
    made, times = Making(), np.arange(61) / 30
    made.json["nodes"] = [{"name": "Prop"}]
    made.channel(0, "rotation", made.times(times), turns(times, 3))
    made.channel(0, "translation", made.times(times), np.column_stack((times, np.sin(times), times**2)))
    path = compressed(made, tmp_path / "prop.glb")
    (expected,) = read_trajectories(str(tmp_path / "prop.glb")).trajectories
    (result,) = read_trajectories(str(path)).trajectories
    np.testing.assert_array_equal(result.poses.positions, expected.poses.positions)
    np.testing.assert_array_equal(result.poses.quaternions, expected.poses.quaternions)
    with pytest.raises(GltfError, match="is compressed by meshopt, which is not read"):
        numbers(read_document(path), 0)


def with_mesh(path: Path, how: str) -> Path:
    """A chain of joints with a skin that a triangle hangs on; its views are compressed, those of the mesh in a way."""
    made = walk()
    points = made.accessor(np.zeros((3, 3), dtype="<f4"))
    four = made.accessor(np.zeros((3, 4), dtype="u1")), made.accessor(np.ones((3, 4), dtype="<f4"))
    corners = made.accessor(np.arange(3, dtype="<u4"))
    attributes = {"POSITION": points, "JOINTS_0": four[0], "WEIGHTS_0": four[1]}
    made.json["meshes"] = [{"primitives": [{"attributes": attributes, "indices": corners}]}]
    made.json["nodes"].append({"mesh": 0, "skin": 0})
    made.json["scenes"] = [{"nodes": [0, len(made.json["nodes"]) - 1]}]
    result = compressed(made, path)
    json_of = json.loads(result.read_text())
    views = [json_of["accessors"][accessor]["bufferView"] for accessor in (points, corners)]
    of_points, of_corners = (json_of["bufferViews"][view]["extensions"]["EXT_meshopt_compression"] for view in views)
    of_corners["mode"] = "TRIANGLES"
    of_points |= {"filtered": {"filter": "COLOR"}, "damaged": {"byteLength": of_points["byteLength"] - 1}}.get(how, {})
    result.write_text(json.dumps(json_of))
    return result


@pytest.mark.parametrize("how", ["plain", "filtered", "damaged"])
def test_triangles_that_are_not_read_leave_the_motion_alone(tmp_path: Path, how: str) -> None:
    path = with_mesh(tmp_path / "walk.glb", how)
    (expected,) = read_trajectories(str(walk().write(tmp_path / "plain.glb"))).trajectories
    (result,) = read_trajectories(str(path)).trajectories
    np.testing.assert_array_equal(result.poses.positions, expected.poses.positions)
    np.testing.assert_array_equal(result.poses.quaternions, expected.poses.quaternions)
    assert "without its skin: " in result.remark


def test_reduce_says_what_to_do_with_it(tmp_path: Path) -> None:
    with pytest.raises(GltfError, match=r"is compressed by meshopt, which is not read; export the file without it"):
        reduced(read_document(with_mesh(tmp_path / "walk.glb", "plain")), Options(0.001))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"\xa1" + bytes(40), "is compressed by a newer meshopt; export the file without it"),
        (b"\xa0" + bytes(30), "is compressed by meshopt, and damaged"),
        (b"\xa0" + bytes(99), "is compressed by meshopt, and damaged"),
        (b"\xa0" + b"\xff" * 40, "is compressed by meshopt, and damaged"),
    ],
)
def test_damage_is_told(data: bytes, problem: str) -> None:
    with pytest.raises(GltfError, match=problem):
        decompressed(document(data, 20, 4))
    with pytest.raises(GltfError, match="says more than it holds"):
        decompressed(document(data, 10**6, 4))
    with pytest.raises(GltfError, match="is more than is read"):
        decompressed(document(data, 10**9, 4))
