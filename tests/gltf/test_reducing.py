"""Key reduction of glTF files: the tolerance holds, and nothing else changes."""

import json
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.gltf import Options, Report, reduce_file
from tests.gltf.making import Making, turns, walk
from tests.gltf.player import File, off

RADIUS = 0.03

ROUNDING = 1e-6
"""Rounding error of single precision, as a fraction of the size."""


def both(
    made: Making, folder: Path, tolerance: float, name: str = "walk.glb", **more: float
) -> tuple[File, File, Report]:
    path = made.write(folder / name)
    output = path.with_stem(f"{path.stem}-reduced")
    report = reduce_file(path, output, Options(tolerance, RADIUS, **more))
    return File(path), File(output), report


def holds(before: File, after: File, report: Report, clip: int = 0) -> float:
    """Return the largest error of a clip, after checking that the tolerance and the report bound it."""
    error = off(before, after, clip, RADIUS).error
    assert error <= report.tolerance + ROUNDING * report.size
    assert error <= report.clips[clip].error + ROUNDING * report.size
    return error


@pytest.mark.parametrize("tolerance", [1e-3, 5e-3, 2e-2])
def test_no_point_around_any_joint_is_off_by_more_than_the_tolerance(tmp_path, tolerance):
    before, after, report = both(walk(), tmp_path, tolerance)
    assert holds(before, after, report) > 0.1 * tolerance
    assert report.clips[0].after.size < 0.7 * report.clips[0].before.size
    assert after.moments(0)[[0, -1]].tolist() == before.moments(0)[[0, -1]].tolist()


def test_what_would_be_off_between_its_keys_gets_more_of_them(tmp_path):
    made, times = walk(5, 4.0, 8.0), np.arange(33) / 8.0
    made.channel(2, "translation", made.times(times), 0.3 * np.random.default_rng(1).normal(size=(33, 3)))
    holds(*both(made, tmp_path, 2e-2))


def test_everything_else_of_the_file_stays(tmp_path):
    made = walk()
    image = made.view(bytes(range(256)))
    made.json |= {
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "odd": [None, {"a": None}, "\ud800é"],
        "extras": 1.5,
    }
    positions = made.accessor(np.eye(3, dtype="<f4"))
    made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": positions}}]}]
    path = made.write(tmp_path / "walk.glb", [(b"ODD\0", b"some")])
    reduce_file(path, tmp_path / "made.glb", Options(1e-3))
    before, after = File(path), File(tmp_path / "made.glb")
    assert [kind for kind, _ in after.chunks] == [b"JSON", b"BIN\0", b"ODD\0"]
    assert after.chunks[2] == before.chunks[2]
    assert after.json["asset"]["extras"].pop("rigid_motion") == {"tolerance": 1e-3}
    changing = {"animations", "accessors", "bufferViews", "buffers", "meshes", "skins", "images"}
    assert {name: part for name, part in before.json.items() if name not in changing} == {
        name: part for name, part in after.json.items() if name not in changing
    }
    for file in (before, after):
        file.image = file.bytes_of(file.json["images"][0].pop("bufferView"))
        file.places = file.numbers(file.json["meshes"][0]["primitives"][0]["attributes"].pop("POSITION"))
        file.inverse = file.numbers(file.json["skins"][0].pop("inverseBindMatrices"))
    assert after.image == before.image
    assert np.array_equal(after.places, before.places)
    assert np.array_equal(after.inverse, before.inverse)
    assert all(before.json[name] == after.json[name] for name in ("images", "meshes", "skins"))


@pytest.mark.parametrize("channels", ["needed", "all"])
@pytest.mark.parametrize("has_mesh", [True, False])
@pytest.mark.parametrize("elsewhere", [0.2, 0.3])
def test_constant_channels_have_one_key_and_those_that_nobody_needs_none(tmp_path, channels, has_mesh, elsewhere):
    made = walk()
    times = made.times([0.0, 1.0])
    made.json["nodes"].append({"name": "Hat", "translation": [0.0, 0.2, 0.0]})
    made.json["nodes"][5]["children"] = [6]
    if has_mesh:
        positions = made.accessor(0.1 * np.eye(3, dtype="<f4"))
        made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": positions}}]}]
        made.json["nodes"][6]["mesh"] = 0
    made.channel(6, "translation", times, np.array([[0.0, 0.2, 0.0]] * 2, dtype="<f4"))
    made.channel(6, "rotation", times, turns(np.zeros(2), 3), "STEP")
    made.channel(6, "translation", times, np.array([[0.0, elsewhere, 0.0]] * 2, dtype="<f4"), clip=1)
    _, after, _ = both(made, tmp_path, 1e-3, channels=channels)
    tracks = after.tracks(0)
    is_free = has_mesh and channels == "needed"
    assert ((6, "translation") in tracks) == (not is_free or elsewhere != 0.2)
    assert all(((joint, "scale") in tracks) == (not is_free) for joint in range(6))
    assert all(len(track[1]) == 1 for (_, path), track in tracks.items() if path == "scale")
    assert len(tracks[6, "rotation"][1]) == 1


def test_nodes_that_share_a_mesh_each_carry_it(tmp_path):
    """A mesh with two materials that share vertices; one node is a hundred times as large as the other."""
    made, times = Making(), np.arange(61) / 30
    places = made.accessor(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], dtype="<f4"))
    made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": places}, "material": 0}] * 2}]
    made.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "scale": [100.0, 100.0, 100.0]}]
    own = made.times(times)
    for node in (0, 1):
        made.channel(node, "rotation", own, turns(times, node))
    path = made.write(tmp_path / "shared.glb")
    report = reduce_file(path, tmp_path / "reduced.glb", Options(5e-3))
    assert 1e-3 < off(File(path), File(tmp_path / "reduced.glb"), 0).error <= 5e-3 + ROUNDING
    small, large = sorted(len(times) for _, times, _ in File(tmp_path / "reduced.glb").tracks(0).values())
    assert report.size == pytest.approx(10.0, rel=0.1)
    assert small < large / 3


def test_weights_of_a_node_without_a_mesh_stay_in_every_clip(tmp_path):
    made, own = walk(), np.array([[0.1], [0.2], [0.1], [0.2]], dtype="<f4")
    made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": made.accessor(np.eye(3, dtype="<f4"))}}]}]
    made.json["nodes"].append({"mesh": 0})
    for clip in (0, 1):
        made.channel(3, "weights", made.times([0.0, 1.0]), own, clip=clip)
    _, after, _ = both(made, tmp_path, 1e-3)
    assert all((3, "weights") in after.tracks(clip) for clip in (0, 1))


def test_who_reduces_again_is_told(tmp_path):
    path = walk().write(tmp_path / "walk.glb")
    for tolerance, earlier in ((1e-3, None), (2e-3, 1e-3), (1e-3, 3e-3)):
        report = reduce_file(path, path, Options(tolerance))
        assert report.reduced_before == (earlier and pytest.approx(earlier))


def test_steps_stay_as_they_are(tmp_path):
    made = walk()
    steps = np.repeat(np.array([[0.0, 0.3, 0.0], [0.1, 0.3, 0.0], [0.2, 0.5, 0.0]]), 4, axis=0)
    made.channel(3, "translation", made.times(np.arange(12) / 6), steps, "STEP")
    before, after, report = both(made, tmp_path, 2e-3)
    kind, times, values = after.tracks(0)[3, "translation"]
    assert (kind, len(times)) == ("STEP", 3)
    assert np.array_equal(values, steps[::4].astype("<f4"))
    holds(before, after, report)


@pytest.mark.parametrize("made", [walk(), Making()], ids=["beside joints", "alone"])
def test_weights_of_morph_targets_keep_to_half_a_percent(tmp_path, made):
    times = np.arange(61) / 30
    made.json["nodes"] = made.json["nodes"] or [{}]
    made.json["nodes"][0]["mesh"] = 0
    made.json["meshes"] = [{"primitives": [{"attributes": {}, "targets": [{}, {}]}], "weights": [0.0, 0.0]}]
    weights = np.column_stack((0.5 + 0.5 * np.sin(3 * times), np.abs(np.cos(times))))
    made.channel(0, "weights", made.times(times), weights.reshape(-1, 1))
    _, after, _ = both(made, tmp_path, 5e-3)
    kind, key_times, values = after.tracks(0)[0, "weights"]
    assert (kind, len(key_times) < 40) == ("LINEAR", True)
    result = [np.interp(times, key_times, column) for column in values.reshape(-1, 2).T]
    assert np.abs(np.transpose(result) - weights).max() <= 0.005 + ROUNDING


def test_a_clip_that_stands_still_lasts_as_long_as_before(tmp_path):
    made = Making()
    made.json["nodes"] = [{"translation": [1.0, 2.0, 3.0]}, {"translation": [2.0, 2.0, 3.0]}]
    for node in (0, 1):
        made.channel(node, "translation", made.times([0.5, 1.0, 2.5]), np.tile([1.0 + node, 2.0, 3.0], (3, 1)))
    _, after, report = both(made, tmp_path, 1e-3)
    assert report.clips[0].after.size < report.clips[0].before.size
    assert after.moments(0).tolist() == [0.5, 2.5]


def test_sparse_strided_normalised_and_scattered_accessors_are_read(tmp_path):
    made = walk()
    made.buffers += [bytearray(), bytearray()]
    times = np.arange(61) / 30
    made.json["nodes"] += [{"translation": [0.1, 0.0, 0.0]} for _ in range(3)]
    made.json["nodes"][5]["children"] = [6, 7, 8]
    own = made.times(times, buffer=1)
    whole = np.rint(turns(times, 11).astype(np.float64) * 32767).astype("<i2")
    made.channel(6, "rotation", own, made.accessor(whole, buffer=2, normalized=True))
    spread = np.zeros((61, 5), dtype="<f4")
    spread[:, :3] = 0.05 * np.column_stack((np.sin(times), np.cos(times), times))
    view = made.view(spread.tobytes(), buffer=2, byteStride=20)
    made.json["accessors"].append({"bufferView": view} | made.described(spread[:, :3]))
    made.channel(7, "translation", own, len(made.json["accessors"]) - 1)
    places, values = np.array([20, 40], dtype="<u2"), np.array([[0.1, 0.2, 0.0], [0.0, 0.1, 0.3]], dtype="<f4")
    sparse = {
        "count": 2,
        "indices": {"bufferView": made.view(places.tobytes()), "componentType": 5123},
        "values": {"bufferView": made.view(values.tobytes())},
    }
    made.json["accessors"].append({"componentType": 5126, "count": 61, "type": "VEC3", "sparse": sparse})
    made.channel(8, "translation", own, len(made.json["accessors"]) - 1)
    before, after, report = both(made, tmp_path, 2e-3)
    holds(before, after, report)
    assert (tmp_path / "walk-reduced2.bin").stat().st_size < (tmp_path / "walk 2.bin").stat().st_size


def test_clips_that_share_numbers_are_reduced_each_for_itself(tmp_path):
    made = walk()
    first = made.json["animations"][0]
    made.json["animations"].append(json.loads(json.dumps(first)) | {"name": "Again"})
    few = made.times([0.0, 1.0])
    made.channel(2, "translation", few, np.eye(3)[:2], clip=2)
    before, after, report = both(made, tmp_path, 2e-3)
    for clip in range(3):
        holds(before, after, report, clip)
    assert report.clips[2].tracks is None
    assert report.clips[0].after.size <= report.clips[0].before.size
    assert report.clips[0].after == report.clips[1].after


def test_a_file_with_an_extension_that_nobody_knows_keeps_its_numbers(tmp_path):
    made = walk()
    positions = made.accessor(np.eye(3, dtype="<f4"))
    made.json |= {"extensionsUsed": ["ACME_hair"], "extensions": {"ACME_hair": {"strands": positions}}}
    before, after, report = both(made, tmp_path, 2e-3)
    holds(before, after, report)
    assert np.array_equal(after.numbers(positions), before.numbers(positions))
    assert after.json["extensions"] == before.json["extensions"]


def test_channels_of_extensions_stay(tmp_path):
    made = walk()
    made.json["extensionsUsed"] = ["KHR_animation_pointer"]
    times = made.times([0.0, 1.0])
    made.channel(0, "pointer", times, np.array([[0.0], [0.7]]))
    channel = made.json["animations"][0]["channels"][-1]
    channel["target"] = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}}
    path = made.write(tmp_path / "walk.glb")
    reduce_file(path, tmp_path / "made.glb", Options(2e-3))
    after = File(tmp_path / "made.glb")
    animation = after.json["animations"][0]
    (result,) = [some for some in animation["channels"] if some["target"] == channel["target"]]
    assert after.numbers(animation["samplers"][result["sampler"]]["output"]).ravel().tolist() == [0.0, np.float32(0.7)]
