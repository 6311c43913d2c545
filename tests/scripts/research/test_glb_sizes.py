"""Tests of the GLB benchmark: it measures what its page says."""

from pathlib import Path

import numpy as np
import pytest

from research.glb_playing import animation_bytes, errors_of, opened, size_of
from tests.gltf.making import Making, walk

MOVED = 0.25


def written(made: Making, path: Path, name: str = "Walk") -> Path:
    made.json["animations"][0]["name"] = name
    return made.write(path)


def moved(made: Making, frame: int) -> Making:
    """Return the file with the first joint displaced on one frame."""
    channel = made.json["animations"][0]["channels"][0]
    output = made.json["animations"][0]["samplers"][channel["sampler"]]["output"]
    view = made.json["bufferViews"][made.json["accessors"][output]["bufferView"]]
    values = np.frombuffer(made.buffers[0], "<f4", view["byteLength"] // 4, view["byteOffset"]).reshape(-1, 3)
    values[frame, 1] += MOVED
    return made


@pytest.fixture
def original(tmp_path: Path) -> Path:
    return written(walk(joints=4), tmp_path / "walk.glb")


def test_errors_are_those_of_the_worst_joint_at_eighths_and_at_frames(original: Path, tmp_path: Path) -> None:
    other = written(moved(walk(joints=4), 20), tmp_path / "other.glb")
    errors = errors_of(opened(original, None), opened(other, None), 0.03)
    assert errors == {
        "joints": pytest.approx(MOVED, rel=1e-5),
        "vertices": None,
        "at_frames": pytest.approx(MOVED, rel=1e-5),
    }


def test_nodes_are_found_by_their_names_in_whatever_order(original: Path, tmp_path: Path) -> None:
    made = walk(joints=4)
    nodes = made.json["nodes"]
    nodes.append(nodes.pop(0))
    order = [1, 2, 3, 0]
    for node in nodes:
        node["children"] = [order.index(child) for child in node.get("children", [])]
    made.json["scenes"] = [{"nodes": [3]}]
    for channel in made.json["animations"][0]["channels"]:
        channel["target"]["node"] = order.index(channel["target"]["node"])
    other = opened(written(made, tmp_path / "other.glb"), None)
    assert errors_of(opened(original, None), other, 0.03)["joints"] < 1e-6


def test_a_clip_that_is_left_out_rests(original: Path, tmp_path: Path) -> None:
    other = opened(written(walk(joints=4), tmp_path / "other.glb", "Other"), None)
    assert errors_of(opened(original, None), other, 0.03)["joints"] > 1.0


def test_bytes_and_size_are_those_of_the_file(original: Path) -> None:
    frames = 61
    assert animation_bytes(original) == frames * (4 + 12 + 4 * 16 + 4 * 12)
    assert size_of(opened(original, None)) == pytest.approx(0.9)
