"""*File > Export > glTF, Reduced*: what Blender's exporter writes, with fewer keys, within the tolerance."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import pytest

from rigid_motion import animation
from tests.gltf.player import File, off

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


def test_the_file_has_fewer_keys_and_shows_the_same(cube, tmp_path):
    export(tmp_path / "reduced.glb")
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "whole.glb"), export_format="GLB")
    whole, reduced = (File(tmp_path / f"{name}.glb") for name in ("whole", "reduced"))
    assert 0.0 < off(whole, reduced, 0, RADIUS).error <= TOLERANCE
    before, after = (sum(len(times) for _, times, _ in file.tracks(0).values()) for file in (whole, reduced))
    assert after < before / 2


def test_selected_objects_alone(cube, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    cube.select_set(True)
    export(tmp_path / "one.glb", use_selection=True)
    assert [node["name"] for node in File(tmp_path / "one.glb").json["nodes"]] == ["Cube"]


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
