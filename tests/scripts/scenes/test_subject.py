"""Tests of the object of a film: loaded from a file, and simplified to few triangles."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion_batch.report.data import MOST_TRIANGLES as MOST_IN_A_PAGE
from rigid_motion_batch.report.data import Mesh
from rigid_motion_batch.scenes.settings import MODELS, SubjectError
from rigid_motion_batch.scenes.subject import MOST_TRIANGLES, load_subject, simplified, vertices_of
from tests.animation.scenes import new_object


def painted(picture: Path) -> bpy.types.Material:
    """Return a material with an image."""
    image = bpy.data.images.new("Paint", 4, 4)
    image.filepath_raw, image.file_format = str(picture), "PNG"
    image.save()
    material = bpy.data.materials.new("Paint")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = bpy.data.images.load(str(picture))
    return material


@pytest.fixture
def user_file(tmp_path, empty_file):
    """Return a file with a cube (with modifier, material and script) under a parent of twice the size, and a lamp."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    cube = bpy.context.object
    cube.data.materials.append(painted(tmp_path / "paint.png"))
    array = cube.modifiers.new("Array", "ARRAY")
    array.use_relative_offset, array.use_constant_offset = False, True
    array.count, array.constant_offset_displace = 3, (10.0, 0.0, 0.0)
    cube.parent = new_object("Parent")
    cube.parent.scale = (2.0, 2.0, 2.0)
    cube.keyframe_insert("location", frame=1)
    bpy.data.texts.new("startup.py").use_module = True
    new_object("Lamp", data=bpy.data.lights.new("Lamp", "POINT"))
    path = tmp_path / "tools.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


def test_a_users_object_comes_with_its_modifiers_and_its_size(user_file):
    vertices = vertices_of(load_subject(f"{user_file}:Cube"))
    assert len(vertices) == 24
    assert np.allclose(np.ptp(vertices, axis=0), (44.0, 4.0, 4.0))


def test_nothing_else_of_the_users_file_stays(user_file):
    scene_blocks = set(bpy.data.user_map())
    mesh = load_subject(f"{user_file}:Cube")
    arrived = set(bpy.data.user_map()) - scene_blocks
    assert arrived == {mesh, mesh.materials[0], bpy.data.images["paint.png"]}
    assert mesh.materials[0].name == "Paint"
    assert not bpy.data.texts


@pytest.mark.parametrize(
    ("expected", "said"),
    [
        ("{file}:Sphere", "tools.blend: has no object 'Sphere'; it has Cube, Lamp, Parent"),
        ("{file}:Lamp", "tools.blend: 'Lamp' has no faces to show"),
        ("{file}:Parent", "tools.blend: 'Parent' has no faces to show"),
        ("{folder}/none.blend:Cube", "none.blend: there is no such file"),
        ("{folder}/text.blend:Cube", "text.blend: is not a .blend file"),
        ("hammer", "object 'hammer': give drill, controller or file.blend:Name"),
    ],
)
def test_what_cannot_be_shown_is_said_in_one_line(expected, said, user_file, tmp_path):
    (tmp_path / "text.blend").write_text("no Blender file\n" * 20)
    before = set(bpy.data.user_map())
    with pytest.raises(SubjectError) as error:
        load_subject(expected.format(file=user_file, folder=tmp_path))
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert set(bpy.data.user_map()) == before


@pytest.mark.parametrize("name", MODELS)
def test_our_models_keep_their_shape_and_what_has_the_colour_of_the_mode(name):
    whole = vertices_of(load_subject(name))
    result = simplified(name)
    assert MOST_TRIANGLES / 2 < len(result["triangles"]) <= MOST_TRIANGLES <= MOST_IN_A_PAGE
    used = result["vertices"][np.unique(result["triangles"])]
    for end in (np.min, np.max):
        assert np.abs(end(used, axis=0) - end(whole, axis=0)).max() < 0.02 * np.ptp(whole, axis=0).max()
    assert {*result["tints"]} == {0.0, 1.0}
    assert Mesh(**result).size == pytest.approx(np.linalg.norm(np.ptp(whole, axis=0)), rel=0.02)


def test_triangles_that_hang_on_nothing_are_kept_within_the_budget(empty_file, tmp_path):
    made = new_object("Dust", data=bpy.data.meshes.new("Dust")).data
    dust = np.random.default_rng(1).normal(size=(3 * 2 * MOST_TRIANGLES, 3))
    made.from_pydata(dust.tolist(), [], np.arange(len(dust)).reshape(-1, 3).tolist())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "dust.blend"))
    result = simplified(f"{tmp_path / 'dust.blend'}:Dust")
    assert 0 < len(result["triangles"]) <= MOST_TRIANGLES
    assert result["triangles"].max() < len(result["vertices"])
