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
from tests.gltf.player import File

POINTER = "KHR_animation_pointer"


def both(made: Making, folder: Path, suffix: str = ".glb") -> tuple[File, File, Report]:
    """Return the file before and after reduction, after checking that the reported sizes are right and none grew."""
    path, output = made.write(folder / f"walk{suffix}"), folder / f"made{suffix}"
    report = reduce_file(path, output, Options(5e-3))
    before, after = size(path), size(output)
    assert (read_document(path).size, read_document(output).size) == (before, after)
    assert after <= before
    return File(path), File(output), report


def size(path: Path) -> int:
    """Return the bytes of a file and its external buffers."""
    uris = {buffer.get("uri", "data:").replace("%20", " ") for buffer in File(path).json["buffers"]}
    return path.stat().st_size + sum((path.parent / uri).stat().st_size for uri in uris if uri[:5] != "data:")


def with_mesh(made: Making) -> dict[str, Any]:
    """Add a mesh, with accessors after the accessors of the animations, and return its only primitive."""
    attributes = {"POSITION": made.accessor(np.random.default_rng(1).normal(size=(30, 3)).astype("<f4"))}
    primitive = {"attributes": attributes, "indices": made.accessor(np.arange(30, dtype="<u2"))}
    made.json["meshes"] = [{"primitives": [primitive]}]
    made.json["nodes"][0]["mesh"] = 0
    return primitive


def packed(made: Making) -> Making:
    """Put the same accessors into `views` views, in random order."""
    data, accessors, content = made.buffers[0], made.json["accessors"], bytearray()
    views = [made.json["bufferViews"][accessor["bufferView"]] for accessor in accessors]
    for number in np.random.default_rng(4).permutation(len(accessors)).tolist():
        begin, length = views[number]["byteOffset"], views[number]["byteLength"]
        accessors[number] |= {"bufferView": 0, "byteOffset": len(content)}
        content += data[begin : begin + length] + bytes(-length % 4)
    made.buffers, made.json["bufferViews"] = [bytearray()], []
    made.view(bytes(content))
    return made


def point(made: Making, sampler: int, pointer: str = "/materials/0/emissiveFactor") -> None:
    """Let a sampler of the first animation also move the target of a pointer."""
    made.json["extensionsUsed"] = [POINTER]
    target = {"path": "pointer", "extensions": {POINTER: {"pointer": pointer}}}
    made.json["animations"][0]["channels"].append({"sampler": sampler, "target": target})


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("EXT_mesh_manifold", lambda number: {"manifoldPrimitive": {"mode": 4, "indices": number}}),
        ("EXT_mesh_primitive_edge_visibility", lambda number: {"visibility": number, "lineStrings": [{"x": 0.5}]}),
        ("KHR_mesh_of_tomorrow", lambda number: {"where": [f"/accessors/{number}"]}),
    ],
)
def test_numbers_that_an_unknown_extension_may_name_stay_and_so_does_what_has_them(tmp_path, name, content):
    made = walk()
    primitive = with_mesh(made)
    number, own = made.accessor(np.arange(30, dtype="<u1")), made.json["animations"][0]["samplers"][1]["output"]
    primitive["extensions"] = {name: content(number)}
    made.json["extensions"] = {name: {"and": own}}
    before, after, report = both(made, tmp_path)
    assert report.clips[0].tracks is not None
    assert (after.json["meshes"], after.json["extensions"]) == (before.json["meshes"], before.json["extensions"])
    for named in (number, own, *primitive["attributes"].values()):
        assert after.numbers(named).tobytes() == before.numbers(named).tobytes()


def test_numbers_move_beside_extensions_that_name_no_accessors(tmp_path):
    made = walk()
    with_mesh(made)
    variants = {"KHR_texture_transform": {"texCoord": 1}}
    made.json["materials"] = [{"extensions": {"KHR_materials_ior": {"ior": 1, "extensions": variants}}}]
    made.json["extensionsUsed"] = ["KHR_materials_ior", "ACME_nothing_here"]
    made.json["extras"] = {"extensions": {"ACME": 3}}
    before, after, _ = both(made, tmp_path)
    assert after.json["meshes"] != before.json["meshes"]
    assert len(after.json["bufferViews"]) < len(before.json["bufferViews"]), "and none has nothing in its place"


def test_no_byte_goes_where_an_unknown_extension_says_where_bytes_are(tmp_path):
    made = walk()
    made.json["extensions"] = {"ACME_sound": {"buffer": 0, "from": 5, "to": 50}}
    before, after, _ = both(made, tmp_path)
    assert after.buffers[0][: len(before.buffers[0])] == before.buffers[0]


def test_a_clip_of_which_an_unknown_extension_says_something_stays(tmp_path):
    made = walk()
    made.json["animations"][0]["samplers"][2]["extensions"] = {"ACME_ease": {"curve": "in"}}
    before, after, report = both(made, tmp_path)
    assert report.clips[0].tracks is None
    assert after.json == before.json


def test_views_lose_what_animations_had_in_them_and_keep_the_rest(tmp_path):
    made = walk()
    primitive = with_mesh(made)
    before, after, report = both(packed(made), tmp_path)
    assert (
        len(after.buffers[0]) < len(before.buffers[0]) - 0.9 * report.clips[0].before.size + report.clips[0].after.size
    )
    (changed,) = after.json["meshes"][0]["primitives"]
    for old, new in (
        (primitive["indices"], changed["indices"]),
        *zip(primitive["attributes"].values(), changed["attributes"].values(), strict=True),
    ):
        assert np.array_equal(before.numbers(old), after.numbers(new))


def test_a_clip_whose_numbers_are_used_by_others_anyway_stays(tmp_path):
    made = walk()
    for sampler in range(len(made.json["animations"][0]["samplers"])):
        point(made, sampler)
    before, after, report = both(made, tmp_path)
    assert (report.clips[0].tracks, report.clips[0].reason) == (None, "fewer keys would take more bytes")
    assert after.json == before.json


def test_clips_that_share_all_are_worth_it_together(tmp_path):
    made = walk()
    made.json["animations"] += [json.loads(json.dumps(made.json["animations"][0])) for _ in range(2)]
    before, after, _ = both(made, tmp_path)
    assert len(after.buffers[0]) < 0.5 * len(before.buffers[0])
    assert after.tracks(0).keys() == after.tracks(2).keys()
    assert len(after.json["accessors"]) <= 1 + 2 * len(after.json["animations"][0]["samplers"])


def test_quaternions_of_any_length_are_stored_as_the_turns_that_they_are():
    times = np.arange(9) / 30
    track = Track(0, 0, "rotation", "LINEAR", times, turns(times, 3).astype(np.float64))
    long = stored(replace(track, values=3.0 * track.values), integers=True).values
    assert np.array_equal(long, stored(track, integers=True).values)
