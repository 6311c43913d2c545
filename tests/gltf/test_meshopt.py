"""Files compressed by meshopt are read, reduced and compressed again; other files are compressed on request."""

import json
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.gltf import Options, read_document, reduce_file, reduced
from rigid_motion.gltf.accessors import numbers
from rigid_motion.gltf.attribute_streams import encoded
from rigid_motion.gltf.documents import Document, GltfError, data_uri
from rigid_motion.gltf.meshopt import Streams, decompressed, packed
from rigid_motion.gltf.tracks import read_clips
from rigid_motion_batch.cli import reduce
from rigid_motion_batch.recordings import read_trajectories
from tests.gltf.making import turns, walk
from tests.gltf.player import File, off

EXT, KHR = "EXT_meshopt_compression", "KHR_meshopt_compression"

TRIANGLES = "e1f0007687566778a9866589689801690000"
"""A stream of one triangle."""


def document(data: bytes, count: int, stride: int, **more: object) -> Document:
    own = {"buffer": 0, "byteLength": len(data), "byteStride": stride, "count": count, "mode": "ATTRIBUTES", **more}
    view = {"buffer": 1, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": own}}
    return Document({"buffers": [{"byteLength": len(data)}, {}], "bufferViews": [view]}, (data, None))


def with_mesh(path: Path, how: str = "", name: str = EXT) -> Path:
    """Write a chain of joints with a skinned triangle; all views are compressed, one mesh view as `how` says."""
    made, data, views = walk(), b"", []
    points = made.accessor(np.zeros((3, 3), dtype="<f4"))
    four = made.accessor(np.zeros((3, 4), dtype="u1")), made.accessor(np.ones((3, 4), dtype="<f4"))
    corners = made.accessor(np.arange(3, dtype="<u4"))
    attributes = {"POSITION": points, "JOINTS_0": four[0], "WEIGHTS_0": four[1]}
    made.json["meshes"] = [{"primitives": [{"attributes": attributes, "indices": corners}]}]
    made.json["nodes"].append({"mesh": 0, "skin": 0})
    made.json["scenes"] = [{"nodes": [0, len(made.json["nodes"]) - 1]}]
    for number, (view, accessor) in enumerate(zip(made.json["bufferViews"], made.json["accessors"], strict=True)):
        content = np.frombuffer(made.buffers[0], np.uint8, view["byteLength"], view["byteOffset"])
        elements = content.reshape(accessor["count"], -1)
        stream = bytes.fromhex(TRIANGLES) if number == corners else encoded(elements)
        own = {"mode": "TRIANGLES" if number == corners else "ATTRIBUTES", "buffer": 0, "byteOffset": len(data)}
        own |= {"byteLength": len(stream), "byteStride": elements.shape[1], "count": len(elements)}
        if number == points:
            own |= {"unknown": {"filter": "HUE"}, "damaged": {"byteLength": len(stream) - 1}}.get(how, {})
        data += stream
        views.append({"buffer": 1, "byteLength": elements.size, "extensions": {name: own}})
    buffers = [{"byteLength": len(data), "uri": data_uri(data)}, {"byteLength": 1, "extensions": {}}]
    path.write_text(json.dumps(made.json | {"bufferViews": views, "buffers": buffers}))
    return path


@pytest.mark.parametrize("how", ["", "unknown", "damaged"])
def test_what_is_compressed_is_read_and_a_mesh_that_cannot_be_read_leaves_the_motion_alone(
    tmp_path: Path, how: str
) -> None:
    path = with_mesh(tmp_path / "walk.gltf", how)
    (expected,) = read_trajectories(str(walk().write(tmp_path / "plain.glb"))).trajectories
    (result,) = read_trajectories(str(path)).trajectories
    np.testing.assert_array_equal(result.poses.positions, expected.poses.positions)
    np.testing.assert_array_equal(result.poses.quaternions, expected.poses.quaternions)
    assert ("without its skin: " in result.remark) == bool(how)


def plain(path: Path, folder: Path) -> Path:
    """Write the same file decompressed."""
    document = decompressed(read_document(path))
    json_of = {name: part for name, part in document.json.items() if not name.startswith("extensions")}
    buffers = [bytes(data or b"-") for data in document.buffers]
    json_of["buffers"] = [{"byteLength": len(data), "uri": data_uri(data)} for data in buffers]
    result = folder / f"{path.stem}-plain.gltf"
    result.write_text(json.dumps(json_of))
    return result


@pytest.mark.parametrize("tolerance", [1e-3, 5e-3])
def test_what_is_compressed_keeps_to_the_tolerance_in_fewer_bytes(tmp_path: Path, tolerance: float) -> None:
    path = walk().write(tmp_path / "walk.glb")
    reports = [
        reduce_file(path, tmp_path / f"{kind}.glb", Options(tolerance, 0.03, meshopt=kind == "packed"))
        for kind in ("packed", "reduced")
    ]
    assert reports[0].clips[0].after.size < 0.7 * reports[1].clips[0].after.size
    error = off(File(path), File(plain(tmp_path / "packed.glb", tmp_path)), 0, 0.03).error
    assert 0.5 * tolerance < error <= min(tolerance, reports[0].clips[0].error * 1.02)
    json_of = read_document(tmp_path / "packed.glb").json
    assert json_of["extensionsRequired"] == json_of["extensionsUsed"] == [EXT]
    filters = [view["extensions"][EXT].get("filter") for view in json_of["bufferViews"] if "extensions" in view]
    assert {"QUATERNION", "EXPONENTIAL"} <= set(filters)


def test_a_clip_lasts_as_long_and_feet_stay_unless_they_may_slide(tmp_path: Path) -> None:
    path = walk().write(tmp_path / "walk.glb")
    held, free = (reduced(read_document(path), Options(2e-2, meshopt=True, feet=feet)) for feet in (True, False))
    assert free.clips[0].after.size <= held.clips[0].after.size
    assert held.clips[0].slides[1] <= held.clips[0].slides[0] + 0.001 * held.size / 1.7 + 1e-6
    moments = [
        (min(track.times[0] for track in clip.tracks), max(track.times[-1] for track in clip.tracks))
        for clip in (read_clips(document)[0] for document in (read_document(path), decompressed(free.document)))
    ]
    assert moments[1] == pytest.approx(moments[0], abs=2.0**-16)


@pytest.mark.parametrize("name", [EXT, KHR])
def test_what_came_compressed_goes_out_so(tmp_path: Path, name: str) -> None:
    path = with_mesh(tmp_path / "walk.gltf", name=name)
    report = reduce_file(path, tmp_path / "made.gltf", Options(2e-3))
    before, after = (decompressed(read_document(it)) for it in (path, tmp_path / "made.gltf"))
    assert not report.left_alone
    assert report.after == (tmp_path / "made.gltf").stat().st_size < report.before
    assert after.json["extensionsUsed"] == [name]
    (view,) = [
        it
        for it in report.document.json["bufferViews"]
        if it.get("extensions", {}).get(name, {}).get("mode") == "TRIANGLES"
    ]
    stream = view["extensions"][name]
    data = bytes(report.document.buffers[0])[stream["byteOffset"] :][: stream["byteLength"]]
    assert data.hex() == TRIANGLES
    for key in ("POSITION", "JOINTS_0", "WEIGHTS_0"):
        own = [numbers(it, it.json["meshes"][0]["primitives"][0]["attributes"][key]) for it in (before, after)]
        assert np.array_equal(*own)


def test_numbers_come_back_bit_by_bit(tmp_path: Path) -> None:
    """For all kinds of numbers, with and without filters."""
    made, times = walk(), np.arange(61) / 30
    made.channel(0, "scale", made.times(times), 1.0 + 0.1 * np.random.default_rng(1).normal(size=(61, 3)))
    whole = np.rint(turns(times, 3).astype(np.float64) * 32767).astype("<i2")
    made.channel(0, "rotation", made.times(times), made.accessor(whole, normalized=True), clip=1)
    document = read_document(made.write(tmp_path / "walk.glb"))
    after = decompressed(packed(document, Streams()).reread())
    for animation, other in zip(document.json["animations"], after.json["animations"], strict=True):
        for sampler, own in zip(animation["samplers"], other["samplers"], strict=True):
            for key in ("input", "output"):
                assert np.array_equal(numbers(document, sampler[key]), numbers(after, own[key]))


def test_files_whose_bytes_may_be_named_elsewhere_are_left_alone(tmp_path: Path) -> None:
    made = walk()
    made.json |= {"extensionsUsed": ["ACME_hair"], "extensions": {"ACME_hair": {"strands": 1}}}
    report = reduced(read_document(made.write(tmp_path / "walk.glb")), Options(2e-3, meshopt=True))
    assert "meshopt moves them: do it without" in report.left_alone


def test_the_option_is_for_gltf_files_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = walk().write(tmp_path / "walk.glb")
    assert reduce.main([str(path), "--meshopt", "--tolerance", "2mm"]) == 0
    assert EXT in read_document(tmp_path / "walk-reduced.glb").json["extensionsUsed"]
    (tmp_path / "hand.csv").write_text("t,x,y,z\n")
    with pytest.raises(SystemExit):
        reduce.main([str(tmp_path / "hand.csv"), "--meshopt"])
    assert "hand.csv is none: add --glb, or leave it out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"\xa2" + bytes(40), "is compressed by meshopt: it is newer than is known here; export the file without it"),
        (b"\xa1" + bytes(40), "is compressed by meshopt: it is damaged"),
        (b"\xa0" + bytes(30), "is compressed by meshopt: it is damaged"),
        (b"\xa0" + bytes(99), "is compressed by meshopt: it is damaged"),
        (b"\xa0" + b"\xff" * 40, "is compressed by meshopt: it is damaged"),
    ],
)
def test_damage_is_told(data: bytes, problem: str) -> None:
    with pytest.raises(GltfError, match=problem):
        decompressed(document(data, 20, 4))
    with pytest.raises(GltfError, match="says more than it holds"):
        decompressed(document(data, 10**6, 4))
    with pytest.raises(GltfError, match="is more than is read"):
        decompressed(document(data, 10**9, 4))
