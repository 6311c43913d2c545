"""*File > Export > glTF, Reduced*: the file of Blender's exporter, with fewer keys, within the tolerance."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from rigid_motion import animation
from tests.animation.scenes import key, new_object
from tests.gltf.player import File, off

TOLERANCE = 0.01
"""Tolerance in metres."""


@pytest.fixture
def cube(extension) -> bpy.types.Object:
    """An object a metre large, on a screw motion between two keys."""
    mesh = bpy.data.meshes.new("Cube")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = key(new_object("Cube", data=mesh), (1.0, 60.0))
    extension.scene.frame_start, extension.scene.frame_end = 1, 60
    animation.set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    return obj


def export(path: Path, **options: object) -> None:
    options = {"tolerance": TOLERANCE, **options}
    assert bpy.ops.rigid_motion.export_gltf(filepath=str(path), **options) == {"FINISHED"}


def test_the_file_has_fewer_keys_and_shows_the_same(cube, tmp_path):
    export(tmp_path / "reduced.glb")
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "whole.glb"), export_format="GLB")
    whole, reduced = (File(tmp_path / f"{name}.glb") for name in ("whole", "reduced"))
    assert 0.0 < off(whole, reduced, 0).error <= TOLERANCE
    before, after = (sum(len(times) for _, times, _ in file.tracks(0).values()) for file in (whole, reduced))
    assert after < before / 2


def test_selected_objects_alone(cube, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    cube.select_set(True)
    export(tmp_path / "one.glb", use_selection=True)
    assert [node["name"] for node in File(tmp_path / "one.glb").json["nodes"]] == ["Cube"]


def test_what_cannot_be_reduced_is_exported_with_all_its_keys(cube, tmp_path):
    export(tmp_path / "large.glb", tolerance=1.0)
    assert all(len(times) == 60 for _, times, _ in File(tmp_path / "large.glb").tracks(0).values())
    cube.animation_data_clear()
    export(tmp_path / "still.glb")
    assert "animations" not in File(tmp_path / "still.glb").json
