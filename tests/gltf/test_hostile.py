"""Damaged and hostile glTF files: each is refused with one line, the problem and a remedy, and nothing is written."""

import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigid_motion.gltf import GltfError, Options, documents, read_document, reduce_file, reduced, tracks
from rigid_motion.gltf.nodes import Nodes
from rigid_motion_batch.cli import reduce
from tests.gltf.making import glb, walk
from tests.gltf.player import File
from tests.thoroughness import tried

RESULT = "walk-reduced"


ZEROS = {"componentType": 5126, "count": 2**25, "type": "VEC3"}


def refusal(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the line that refuses a file, without its path, after checking that nothing was written."""
    before = sorted(os.listdir(path.parent))
    assert reduce.main([str(path)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    line, *_ = said.err.splitlines()
    assert sorted(os.listdir(path.parent)) == before
    assert "Traceback" not in said.err
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def changed(path: Path, change: Callable[[dict[str, Any]], None], text: str = "") -> Path:
    """Write a walk with changed JSON, and return its path."""
    file = File(walk().write(path))
    change(file.json)
    path.write_bytes(glb((text or json.dumps(file.json)).encode(), file.buffers[0]))
    return path


def put(*keys: str | int, to: object) -> Callable[[dict[str, Any]], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (put("accessors", 1, "count", to=2**40), "accessor 1 has 1099511627776 elements, more than are read"),
        (put("accessors", 1, "count", to=-1), "count is -1, and has to be a whole number from 1 on"),
        (put("accessors", 1, "count", to=99), "accessor 1 reaches beyond the bytes that it names"),
        (put("accessors", 1, "byteOffset", to=2**50), "accessor 1 reaches beyond the bytes that it names"),
        (put("accessors", 1, "componentType", to=[]), "components of the type [], which glTF does not know"),
        (put("bufferViews", 1, "byteStride", to=1), "accessor 1 reaches beyond the bytes that it names"),
        (put("buffers", 0, "byteLength", to=2**30), f"of {2**30} bytes; copy the file again, or export it again"),
        (put("nodes", 5, "children", to=[5]), "node 5 hangs on nodes 4 and 5; export it again"),
        (put("nodes", 5, "children", to=[2]), "node 2 hangs on nodes 1 and 5; export it again"),
        (put("nodes", 5, "rotation", to=[0, 0, 0, 0]), "the rotation of node 5 is of length zero; export it again"),
        (put("nodes", 5, "translation", to=[1e300] * 3), "and not 3 numbers; export it again"),
        (put("nodes", 5, to=None), "nodes is not a list of objects; export it again"),
        (put("animations", 0, "channels", 1, "sampler", to=True), "samplers has no entry True"),
        (put("animations", 0, "samplers", 0, "interpolation", to="CUBIC"), "'CUBIC' is none of LINEAR"),
        (put("animations", 0, "samplers", 0, "input", to=2), "its times are no single numbers; export it again"),
        (put("accessors", 1, "bufferView", to=2), "its times do not rise (0"),
        (put("accessors", 2, to=ZEROS), f"accessor 2 has {2**25} elements, more than are read; export it again"),
        (put("animations", 0, "samplers", 0, "output", to=1), "61 values do not fit 61 keys of translation"),
        (put("animations", 0, "channels", 0, "target", to="all"), "channel 0 has no target; export it again"),
        (put("skins", 0, "inverseBindMatrices", to={}), "this glTF is damaged"),
        (put("buffers", 0, "uri", to="data:,%00"), "buffer 0 is text that is not in base64; export it again"),
        (put("buffers", 0, "uri", to="../../etc/passwd"), "buffer 0 is outside of its folder ('../../etc/passwd')"),
        (put("buffers", 0, "uri", to="file:///etc/passwd"), "buffer 0 is outside of its folder ('file:///etc/passwd')"),
        (put("buffers", 0, "uri", to="a\\..\\..\\secret"), "buffer 0 is outside of its folder"),
        (put("buffers", 0, "uri", to="//host/secret"), "buffer 0 is outside of its folder"),
        (put("buffers", 0, "uri", to="HTTP://localhost:1/"), "buffer 0 is outside of its folder"),
        (
            put("buffers", 0, "uri", to="not there.bin"),
            "buffer 0, 'not there.bin', is not there; bring that file along",
        ),
        (put("buffers", 0, "uri", to="long" * 999), "is not there; bring that file along"),
        (put("buffers", 0, "uri", to="a b:c"), "buffer 0 is outside of its folder ('a b:c')"),
        (put("bufferViews", 1, "extensions", to={"EXT_meshopt_compression": {}}), "is compressed by meshopt"),
    ],
)
def test_each_is_refused_in_one_line(tmp_path, capsys, change, line):
    assert line in refusal(changed(tmp_path / "walk.glb", change), capsys)


def test_json_that_is_none_or_too_much_is_refused(tmp_path, capsys, monkeypatch):
    path = tmp_path / "walk.glb"
    for text, line in (
        ("{", "this is not glTF (its JSON cannot be read"),
        ("[" * 200_000, "its JSON has 200000 lists and objects in one another, more than the 128 that are read"),
        ('{"extras":' * 900 + "1" + "}" * 900, "its JSON has 900 lists and objects in one another"),
        (json.dumps(["[" * 900, '"]\\"{' * 900]), "this is not glTF (its JSON is not an object)"),
        ("[]", "this is not glTF (its JSON is not an object); export it again"),
        ('{"nodes": [{"scale": [1e999, 1, 1]}]}', "this is not glTF (its JSON cannot be read: 1e999 is not a number)"),
    ):
        assert line in refusal(changed(path, lambda _: None, text), capsys)
    monkeypatch.setattr(documents, "MOST_VALUES", 100)
    assert "values of JSON are more than the 100 that are read" in refusal(changed(path, lambda _: None), capsys)


def test_channels_that_share_numbers_without_end_are_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(tracks, "MOST_ZEROS", 0)
    path, animation = tmp_path / "walk.glb", File(walk().write(tmp_path / "walk.glb")).json["animations"][0]
    line = ": too many channels share the numbers of so small a file; export fewer clips"
    assert line in refusal(changed(path, put("animations", to=[animation] * 20)), capsys)


def test_whole_numbers_may_be_longer_than_those_of_computers(tmp_path):
    document = read_document(changed(tmp_path / "walk.glb", put("nodes", 0, "translation", to=[10**29, 0.5, 0])))
    assert Nodes(document).rest["translation"][0].tolist() == [1e29, 0.5, 0.0]


def test_chunks_that_lie_are_refused(tmp_path, capsys):
    path = walk().write(tmp_path / "walk.glb")
    content = path.read_bytes()
    for begin, value, line in (
        (4, 1, "this is GLB 1, and 2 is known; export it as glTF 2.0"),
        (8, len(content) + 1, f"{len(content)} of {len(content) + 1} bytes are here; copy the file again"),
        (12, 2**32 - 1, "a part of this file is longer than the whole; export it again"),
        (16, 0, "this GLB holds no JSON; export it again"),
    ):
        path.write_bytes(content[:begin] + struct.pack("<I", value) + content[begin + 4 :])
        assert line in refusal(path, capsys)
    path.write_bytes(glb(b"{}", b"", [(b"MORE", b"")] * 1000))
    assert "this GLB has more than 1000 parts; export it again" in refusal(path, capsys)
    path.write_bytes(content[: len(content) // 2])
    assert "bytes are here" in refusal(path, capsys)


def test_a_chain_without_end_is_refused(tmp_path, capsys):
    line = "more than 1000 nodes hang on one another; export a shorter chain"
    nodes = [{"children": [number + 1]} for number in range(2000)]
    assert line in refusal(changed(tmp_path / "walk.glb", put("nodes", to=[*nodes, {}])), capsys)


@pytest.mark.slow
def test_whatever_is_damaged_is_refused_or_does_no_harm(tmp_path):
    file = File(walk(joints=2, seconds=0.3).write(tmp_path / "walk.glb"))
    random, path = np.random.default_rng(3), tmp_path / "damaged.glb"
    values = [None, -1, 0, 1, 3, 2**40, 1.5, "x", "../x", [], {}, True, [[]], {"uri": 3}]
    refused, count = 0, tried(300)
    for _ in range(count):
        document = json.loads(json.dumps(file.json))
        for _ in range(int(random.integers(1, 4))):
            part: Any = document
            while True:
                keys = list(part) if isinstance(part, dict) else list(range(len(part)))
                key = keys[int(random.integers(len(keys)))]
                if not isinstance(part[key], (dict, list)) or not part[key] or random.random() < 0.15:
                    break
                part = part[key]
            part[key] = values[int(random.integers(len(values)))]
        content = bytearray(glb(json.dumps(document).encode(), file.buffers[0]))
        for place in random.integers(len(content), size=random.choice([0, 0, 1, 8])):
            content[place] = random.integers(256)
        path.write_bytes(content)
        try:
            reduce_file(path, tmp_path / "made.glb", Options(1e-3))
            reduced(read_document(tmp_path / "made.glb"), Options())
        except GltfError as error:
            lines = str(error).splitlines()
            refused += len(lines)
    assert count / 3 < refused < count, "one line each, and not all of them are refused"
