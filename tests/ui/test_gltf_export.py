"""*File > Export > glTF, Reduced*: what Blender's exporter writes, with fewer keys, within the tolerance."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.gltf import read_document
from rigid_motion.gltf.nodes import Nodes, by_target
from rigid_motion.gltf.tracks import read_clips

TOLERANCE, RADIUS = 0.01, 0.05
"""Metres."""


@pytest.fixture
def cube(extension) -> bpy.types.Object:
    """A cube with a screw between three keys, 2 m and 150 degrees."""
    mesh = bpy.data.meshes.new("Cube")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = bpy.data.objects.new("Cube", mesh)
    bpy.context.scene.collection.objects.link(obj)
    obj.rotation_mode = "QUATERNION"
    for frame, x, degrees in ((1, 0.0, 0.0), (30, 1.0, 150.0), (60, 2.0, 20.0)):
        obj.location.x = x
        obj.rotation_quaternion = (math.cos(math.radians(degrees) / 2), 0.0, 0.0, math.sin(math.radians(degrees) / 2))
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_quaternion", frame=frame)
    extension.scene.frame_start, extension.scene.frame_end = 1, 60
    animation.set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    return obj


def export(path: Path, **options: object) -> None:
    options = {"tolerance": TOLERANCE, "radius": RADIUS, **options}
    assert bpy.ops.rigid_motion.export_gltf(filepath=str(path), **options) == {"FINISHED"}


def played(path: Path, times: np.ndarray) -> np.ndarray:
    """Where the origin and three points within the radius are, shape (m, 4, 3)."""
    document = read_document(path)
    (clip,) = read_clips(document)
    maps = Nodes(document).worlds(np.array([0]), by_target(clip.tracks), times)
    points = RADIUS * np.vstack((np.zeros(3), np.eye(3)))
    return maps.origins[0][:, None] + np.einsum("mij,pj->mpi", maps.axes[0], points)


def test_the_file_has_fewer_keys_and_shows_the_same(cube, tmp_path):
    export(tmp_path / "reduced.glb")
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "whole.glb"), export_format="GLB")
    (whole,), (reduced,) = (read_clips(read_document(tmp_path / f"{name}.glb")) for name in ("whole", "reduced"))
    times = np.arange(8 * 60) / (8 * bpy.context.scene.render.fps)
    errors = np.linalg.norm(played(tmp_path / "reduced.glb", times) - played(tmp_path / "whole.glb", times), axis=-1)
    assert 0.0 < errors.max() <= TOLERANCE
    assert sum(len(track.times) for track in reduced.tracks) < sum(len(track.times) for track in whole.tracks) / 2


def test_selected_objects_alone(cube, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    cube.select_set(True)
    export(tmp_path / "one.glb", use_selection=True)
    content = (tmp_path / "one.glb").read_bytes()
    nodes = json.loads(content[20 : 20 + struct.unpack_from("<I", content, 12)[0]])["nodes"]
    assert [node["name"] for node in nodes] == ["Cube"]


def test_what_cannot_be_written_is_said_and_what_was_there_stays(cube, tmp_path):
    target = tmp_path / "kept.glb"
    target.write_bytes(b"mine")
    with pytest.raises(RuntimeError, match="more than a tenth of the size"):
        bpy.ops.rigid_motion.export_gltf(filepath=str(target), tolerance=1.0, check_existing=False)
    assert target.read_bytes() == b"mine"
    cube.animation_data_clear()
    with pytest.raises(RuntimeError, match="no animation moves a node"):
        bpy.ops.rigid_motion.export_gltf(filepath=str(target), tolerance=TOLERANCE)
    assert target.read_bytes() == b"mine"
