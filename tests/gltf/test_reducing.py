"""Key reduction changes only the animations of a file: other data and its references stay, and no file grows."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigid_motion.gltf import Options, Report, read_document, reduce_file
from rigid_motion.gltf.rewriting import stored
from rigid_motion.gltf.tracks import Track
from tests.gltf.making import Making, turns, walk
from tests.gltf.player import File, off

RADIUS, TOLERANCE = 0.03, 5e-3

ROUNDING = 1e-6
"""Rounding error of single precision, as a fraction of the size."""


def both(
    made: Making, folder: Path, tolerance: float | None, name: str = "walk.glb", **more: object
) -> tuple[File, File, Report]:
    """Return the file before and after reduction, after checking that the reported sizes are right and none grew."""
    path = made.write(folder / name)
    output = path.with_stem(f"{path.stem}-reduced")
    report = reduce_file(path, output, Options(tolerance, RADIUS, **more))
    before, after = size(path), size(output)
    assert (read_document(path).size, read_document(output).size) == (before, after)
    assert after <= before
    return File(path), File(output), report


def size(path: Path) -> int:
    """Return the bytes of a file and its external buffers."""
    uris = {buffer.get("uri", "data:").replace("%20", " ") for buffer in File(path).json["buffers"]}
    return path.stat().st_size + sum((path.parent / uri).stat().st_size for uri in uris if uri[:5] != "data:")


def test_other_parts_images_and_notes_stay(tmp_path):
    made = walk()
    image = made.view(bytes(range(256)))
    made.json |= {"images": [{"bufferView": image}], "odd": [None, {"a": None}, "\ud800é"], "extras": 1.5}
    path = made.write(tmp_path / "walk.glb", [(b"ODD\0", b"some")])
    reduce_file(path, tmp_path / "made.glb", Options(1e-3))
    before, after = File(path), File(tmp_path / "made.glb")
    assert [kind for kind, _ in after.chunks] == [b"JSON", b"BIN\0", b"ODD\0"]
    assert after.chunks[2] == before.chunks[2]
    assert after.json["asset"]["extras"].pop("rigid_motion") == {"tolerance": 1e-3}
    assert all(after.json[name] == before.json[name] for name in ("asset", "odd", "extras"))
    assert after.bytes_of(after.json["images"][0]["bufferView"]) == bytes(range(256))


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
    error = off(before, after, 0, RADIUS).error
    assert error <= min(report.tolerance, report.clips[0].error) + ROUNDING * report.size
    assert (tmp_path / "walk-reduced2.bin").stat().st_size < (tmp_path / "walk 2.bin").stat().st_size


# Bytes


def with_mesh(made: Making) -> dict[str, Any]:
    """Add a mesh, with accessors after the accessors of the animations, and return its only primitive."""
    attributes = {"POSITION": made.accessor(np.random.default_rng(1).normal(size=(30, 3)).astype("<f4"))}
    primitive = {"attributes": attributes, "indices": made.accessor(np.arange(30, dtype="<u2"))}
    made.json["meshes"] = [{"primitives": [primitive]}]
    made.json["nodes"][0]["mesh"] = 0
    return primitive


def test_numbers_that_an_unknown_extension_may_name_stay_and_so_does_what_has_them(tmp_path):
    made = walk()
    primitive = with_mesh(made)
    numbers = [made.accessor(np.arange(30, dtype="<u1")) for _ in range(3)]
    first, second, third = numbers
    own = made.json["animations"][0]["samplers"][1]["output"]
    named = {"visibility": first, "lineStrings": [{"indices": second}], "where": [f"/accessors/{third}"]}
    primitive["extensions"], made.json["extensions"] = {"ACME_edges": named}, {"ACME_edges": {"and": own}}
    before, after, report = both(made, tmp_path, TOLERANCE)
    assert report.clips[0].tracks is not None
    assert (after.json["meshes"], after.json["extensions"]) == (before.json["meshes"], before.json["extensions"])
    for number in (*numbers, own, *primitive["attributes"].values()):
        assert after.numbers(number).tobytes() == before.numbers(number).tobytes()


def test_numbers_move_beside_extensions_that_name_no_accessors(tmp_path):
    made = walk()
    with_mesh(made)
    variants = {"KHR_texture_transform": {"texCoord": 1}}
    made.json["materials"] = [{"extensions": {"KHR_materials_ior": {"ior": 1, "extensions": variants}}}]
    made.json["extensionsUsed"] = ["KHR_materials_ior", "ACME_nothing_here"]
    made.json["extras"] = {"extensions": {"ACME": 3}}
    before, after, _ = both(made, tmp_path, TOLERANCE)
    assert after.json["meshes"] != before.json["meshes"]
    assert len(after.json["bufferViews"]) < len(before.json["bufferViews"]), "and none has nothing in its place"


def test_no_byte_goes_where_an_unknown_extension_says_where_bytes_are(tmp_path):
    made = walk()
    made.json["extensions"] = {"ACME_sound": {"buffer": 0, "from": 5, "to": 50}}
    before, after, _ = both(made, tmp_path, TOLERANCE)
    assert after.buffers[0][: len(before.buffers[0])] == before.buffers[0]


def test_a_clip_of_which_an_unknown_extension_says_something_stays(tmp_path):
    made = walk()
    made.json["animations"][0]["samplers"][2]["extensions"] = {"ACME_ease": {"curve": "in"}}
    before, after, report = both(made, tmp_path, TOLERANCE)
    assert report.clips[0].tracks is None
    assert after.json == before.json


def packed(made: Making) -> Making:
    """Put the same accessors into one view, in random order."""
    data, accessors, content = made.buffers[0], made.json["accessors"], bytearray()
    views = [made.json["bufferViews"][accessor["bufferView"]] for accessor in accessors]
    for number in np.random.default_rng(4).permutation(len(accessors)).tolist():
        begin, length = views[number]["byteOffset"], views[number]["byteLength"]
        accessors[number] |= {"bufferView": 0, "byteOffset": len(content)}
        content += data[begin : begin + length] + bytes(-length % 4)
    made.buffers, made.json["bufferViews"] = [bytearray()], []
    made.view(bytes(content))
    return made


def test_views_lose_what_animations_had_in_them_and_keep_the_rest(tmp_path):
    made = walk()
    with_mesh(made)
    before, after, report = both(packed(made), tmp_path, TOLERANCE)
    (clip,) = report.clips
    assert len(after.buffers[0]) < len(before.buffers[0]) - 0.9 * clip.before.size + clip.after.size
    old, new = (file.json["meshes"][0]["primitives"][0] for file in (before, after))
    assert np.array_equal(before.numbers(old["indices"]), after.numbers(new["indices"]))


def test_a_clip_whose_numbers_are_used_by_others_anyway_stays(tmp_path):
    made = walk()
    for sampler in list(made.json["animations"][0]["samplers"]):
        made.pointer("/materials/0/emissiveFactor", sampler["input"], sampler["output"])
    before, after, report = both(made, tmp_path, TOLERANCE)
    assert (report.clips[0].tracks, report.clips[0].reason) == (None, "fewer keys would take more bytes")
    assert after.json == before.json


def test_clips_that_share_all_are_worth_it_together(tmp_path):
    made = walk()
    made.json["animations"] += [json.loads(json.dumps(made.json["animations"][0])) for _ in range(2)]
    before, after, _ = both(made, tmp_path, TOLERANCE)
    assert len(after.buffers[0]) < 0.5 * len(before.buffers[0])
    assert after.tracks(0).keys() == after.tracks(2).keys()
    assert len(after.json["accessors"]) <= 1 + 2 * len(after.json["animations"][0]["samplers"])


def test_quaternions_of_any_length_are_stored_as_the_turns_that_they_are():
    times = np.arange(9) / 30
    track = Track(0, 0, "rotation", "LINEAR", times, turns(times, 3).astype(np.float64))
    long = stored(replace(track, values=3.0 * track.values), integers=True).values
    assert np.array_equal(long, stored(track, integers=True).values)
