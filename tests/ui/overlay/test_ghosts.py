"""Ghosts are where Blender shows the thing itself on their frames, and look like it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay.cache import path_of
from rigid_motion.ui.overlay.ghosts import MOST_EDGES, MOST_GHOSTS, ghost_frames, octahedron, shape_of
from rigid_motion.ui.overlay.points import space_of_object
from tests.animation.bones.poses import shown_poses
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object
from tests.ui.overlay.test_parents import SETTINGS, WHOLE
from tests.ui.rigs import FRAMES, key_bone, new_rig, path_and_space


@pytest.fixture
def ghostly(scene) -> bpy.types.Scene:
    scene.rigid_motion_overlay.show_ghosts = True
    scene.rigid_motion_overlay.ghost_step = 4
    return scene


def assert_as_shown(path, space, matrices):
    """The ghosts are on their frames, as these matrices on all whole frames from the first on have it."""
    assert path.ghosts.frames.tolist() == list(range(4, 41, 4))
    placed = path.ghosts.matrices if path.in_world else np.array(space) @ path.ghosts.matrices
    assert placed == pytest.approx(matrices[path.ghosts.frames.astype(int) - 1], abs=3e-5)


@pytest.mark.parametrize("under", ["nothing", "a table that stands", "a table that moves"])
@pytest.mark.parametrize("scale", [None, "even", "uneven"])
@pytest.mark.parametrize("order", ["QUATERNION", "XZY"])
def test_ghosts_of_an_object_are_where_it_is_shown(ghostly, under, scale, order):
    obj = key(new_object(rotation_mode=order), FRAMES, scale=scale)
    obj.delta_location = (0.3, 0.2, 0.1)
    if scale is None:
        obj.scale = (1.0, 2.0, 0.5)
    if under != "nothing":
        obj.parent = new_object("Table")
        obj.parent.location, obj.parent.scale = (1.0, 2.0, 3.0), (2.0, 1.0, 1.0)
        if under.endswith("moves"):
            key(obj.parent, FRAMES, seed=3)
    set_mode(obj, "motor_spline")
    bpy.context.view_layer.update()
    path, space = path_of(obj, ghostly), space_of_object(obj, bpy.context.evaluated_depsgraph_get())
    assert_as_shown(path, space, shown_worlds([obj], WHOLE)[0])


@SETTINGS
@pytest.mark.parametrize("under", ["stands", "moves"])
@pytest.mark.parametrize("moved", [False, True])
def test_ghosts_of_a_bone_are_where_it_is_shown(ghostly, setting, under, moved):
    rig = new_rig(**setting)
    rig.pose.bones["Arm"].rotation_quaternion = (0.8, 0.0, 0.0, 0.6)
    if under == "moves":
        set_mode(key_bone(rig.pose.bones["Hip"]), "dq_sclerp")
    hand = key_bone(rig.pose.bones["Hand"], location=moved)
    hand.location = hand.location if moved else (0.3, 0.2, 0.1)
    set_mode(hand, "motor_spline")
    bpy.context.view_layer.update()
    path, space = path_and_space(hand)
    assert path.in_world == (under == "moves")
    assert_as_shown(path, space, np.array(rig.matrix_world) @ shown_poses([rig], WHOLE)[0]["Hand"])


def test_of_a_long_motion_there_are_no_more_than_can_be_drawn():
    assert ghost_frames(1, 41, 5).tolist() == [5, 10, 15, 20, 25, 30, 35, 40]
    assert len(ghost_frames(0, 100000, 1)) <= MOST_GHOSTS + 1


def test_an_object_looks_like_its_evaluated_geometry(scene):
    mesh = bpy.data.meshes.new("Square")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    obj = new_object("Square", data=mesh)
    graph = bpy.context.evaluated_depsgraph_get()
    shape = shape_of(transform_of(obj), graph)
    assert shape.lines.shape == (8, 3)
    assert shape.triangles.shape == (6, 3)
    obj.modifiers.new("Array", "ARRAY").count = 3000
    bpy.context.view_layer.update()
    shape = shape_of(transform_of(obj), bpy.context.evaluated_depsgraph_get())
    assert shape.triangles.shape == (18000, 3)
    assert len(shape.lines) == 0, f"more than {MOST_EDGES} edges hide one another"


def test_what_has_no_geometry_is_a_cross_or_a_box(scene):
    empty = new_object("Empty")
    empty.empty_display_size = 2.0
    graph = bpy.context.evaluated_depsgraph_get()
    shape = shape_of(transform_of(empty), graph)
    assert np.abs(shape.lines).max() == 2.0
    assert len(shape.triangles) == 0


def test_a_bone_is_an_octahedron_of_its_length():
    shape = octahedron(2.0)
    assert shape.lines.shape == (24, 3)
    assert shape.triangles.shape == (24, 3)
    assert (shape.lines[:, 1].min(), shape.lines[:, 1].max()) == (0.0, 2.0)
    middle = np.array((0.0, 0.5, 0.0))
    corners = shape.triangles.reshape(-1, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - middle) > 0.0).all(), "faces look outwards"
