"""Tests of `reduce.py --glb`: .blend files, FBX files and recordings, exported as GLB by Blender and then reduced."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.keying import exporting
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.animation.farm import played_on_a_farm
from tests.gltf.player import File, off
from tests.scripts.bvh_bodies import write_body
from tests.scripts.reducing import FRAMES, WALK, joints_in_metres, rig_file, run, write_csv

pytestmark = pytest.mark.blender

MM = 1e-3

SINGLE = 2e-5
"""Allowed rounding in metres: GLB files and Blender's matrices are in single precision."""


@pytest.fixture
def exported(monkeypatch, tmp_path) -> Path:
    """A copy of the last file that Blender's exporter wrote."""
    copy, export = tmp_path / "exported" / "sampled.glb", exporting.export_glb
    copy.parent.mkdir()

    def export_and_copy(path: Path) -> None:
        export(path)
        shutil.copy2(path, copy)

    monkeypatch.setattr(exporting, "export_glb", export_and_copy)
    return copy


def node_of(file: File, name: str) -> int:
    (result,) = (number for number, node in enumerate(file.json["nodes"]) if node.get("name") == name)
    return result


def require_near_export(made: Path, exported: Path, tolerance: float, radius: float) -> None:
    """Check the error at eighths between the keys of both files, and that no exported clip is missing."""
    sampled, file = File(exported), File(made)
    assert len(sampled.json["animations"]) == len(file.json["animations"])
    for clip in range(len(sampled.json["animations"])):
        assert off(sampled, file, clip, radius).error <= tolerance + 1e-6


def test_a_bvh_becomes_a_glb_in_metres_within_the_tolerance(tmp_path, capsys, exported):
    body = write_body(tmp_path / "body.bvh")
    assert run(body, "--glb", "--tolerance", "5mm", "--radius", "0.03") == 0
    made = tmp_path / f"{body.stem}-reduced.glb"
    said = capsys.readouterr()
    assert said.out == f"{made}\n"
    assert " bytes, " in said.err
    assert " m large" in said.err
    require_near_export(made, exported, 5 * MM, 0.03)
    # The joints are where the recording's reader has them; glTF has the axes of BVH, and frame 1 comes first.
    ((clip,), _), file = read_source(str(body), None), File(made)
    worlds = file.worlds(0, clip.times - clip.times[0] + 1.0 / clip.samples_a_second)
    nodes = [node_of(file, joint) for joint in clip.rest_body.joints]
    errors = np.linalg.norm(worlds[nodes][..., :3, 3] - joints_in_metres(clip), axis=-1)
    assert 0.0 < errors.max() <= 5 * MM + SINGLE
    assert made.stat().st_size < exported.stat().st_size


@pytest.mark.recordings
def test_an_fbx_keeps_its_meshes_and_skins(tmp_path, exported):
    assert run(WALK, "--glb", "--tolerance", "2mm", "--radius", "0.03", "--output", tmp_path) == 0
    made = tmp_path / "pab_walk-reduced.glb"
    require_near_export(made, exported, 2 * MM, 0.03)
    sampled, file = File(exported), File(made)
    for what in ("nodes", "skins", "meshes", "materials"):
        assert len(sampled.json.get(what, [])) == len(file.json.get(what, []))
    assert made.stat().st_size < exported.stat().st_size


@pytest.mark.parametrize("mode", ["blender", "motor_spline"])
def test_a_blend_file_is_exported_as_it_plays(tmp_path, exported, mode):
    source = rig_file(tmp_path / "shot.blend")
    if mode != "blender":
        assert run(source, "--mode", mode, "--tolerance", "5mm", "--radius", "0.1") == 0
        source = tmp_path / "shot-reduced.blend"
    assert run(source, "--glb", "--tolerance", "2mm", "--radius", "0.1") == 0
    made = tmp_path / f"{source.stem}-reduced.glb"
    require_near_export(made, exported, 2 * MM, 0.1)
    probes = ["at Root", "at Arm", "at Hand"]
    truth = played_on_a_farm(source, probes, FRAMES)[1][..., :3, 3]
    file = File(made)
    assert len(file.json["animations"]) == 1, "the dense keys for Restore Keys are no clip"
    worlds = file.worlds(0, FRAMES / 24.0)[[node_of(file, name) for name in probes]][..., :3, 3]
    x, y, z = np.moveaxis(truth, -1, 0)
    assert np.linalg.norm(worlds - np.stack((x, z, -y), axis=-1), axis=-1).max() <= 2 * MM + SINGLE


def test_a_rigid_recording_becomes_a_node(tmp_path):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path)
    assert run(path, "--glb", "--tolerance", "5mm") == 0
    file = File(tmp_path / "hand-reduced.glb")
    worlds = file.worlds(0, times + 1.0 / 90.0)[node_of(file, "hand")]
    x, y, z = poses.positions.T
    assert np.linalg.norm(worlds[:, :3, 3] - np.column_stack((x, z, -y)), axis=-1).max() <= 5 * MM + SINGLE
    assert len(file.moments(0)) < len(times)
