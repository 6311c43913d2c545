"""Ghosts: with paths and axes they are where Blender shows the object on their frames, and they look like it."""

from __future__ import annotations

from itertools import product

import bmesh
import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay.ghost_bodies import seen_bodies
from rigid_motion.ui.overlay.ghost_drawing import box_of, covered_by, fades, thinned_out
from rigid_motion.ui.overlay.ghosts import (
    FEW_TRIANGLES,
    MOST_EDGES,
    MOST_GHOSTS,
    fewer_triangles,
    ghost_frames,
    octahedron,
    shape_of,
)
from tests.animation.bones.rigs import in_turn, select_bones
from tests.animation.scenes import key, new_object
from tests.ui.overlay.seen import assert_where_it_is_seen
from tests.ui.rigs import FRAMES, key_bone, new_rig

KEYS = np.array((1.0, 7.5, 41.0))


@pytest.mark.parametrize(
    ("under", "how"),
    in_turn(
        ("nothing", "a table that stands", "a table that moves"),
        tuple(product((None, "even", "uneven"), ("QUATERNION", "XZY"))),
    ),
)
def test_an_object_is_where_it_is_shown(scene, under, how):
    scale, order = how
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
    scene.rigid_motion_overlay.ghost_step = 4
    path = assert_where_it_is_seen(obj, scene)
    assert path.ghosts.frames.tolist() == list(range(4, 41, 4))


SETTINGS = (
    *({}, {"use_local_location": False}, {"use_inherit_rotation": False}),
    *({"inherit_scale": "NONE"}, {"use_connect": True}),
)


@pytest.mark.parametrize(("setting", "how"), in_turn(SETTINGS, [*product(("stands", "moves"), (False, True))]))
def test_a_bone_is_where_it_is_shown_by_its_tail_if_nothing_moves_it(scene, setting, how):
    under, moved = how
    rig = new_rig(**setting)
    rig.pose.bones["Arm"].rotation_quaternion = (0.8, 0.0, 0.0, 0.6)
    for name in ("Hip", "Arm") if under == "moves" else ():
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    hand = key_bone(rig.pose.bones["Hand"], location=moved)
    hand.location = hand.location if moved else (0.3, 0.2, 0.1)
    set_mode(hand, "motor_spline")
    head = moved and not setting.get("use_connect")
    path = assert_where_it_is_seen(hand, scene, (0.0, 0.0 if head else hand.bone.length, 0.0))
    assert path.in_world == (under == "moves")
    assert np.linalg.norm(path.axes[:, :, 1] - path.axes[:, :, 0], axis=2) == pytest.approx(0.5 * hand.bone.length)


def test_of_a_long_motion_there_are_no_more_than_can_be_drawn():
    assert ghost_frames(1, 41, 5, KEYS).tolist() == [5, 10, 15, 20, 25, 30, 35, 40]
    assert ghost_frames(1, 41, -1, KEYS).tolist() == KEYS.tolist()
    assert len(ghost_frames(0, 100000, 1, KEYS)) <= MOST_GHOSTS + 1


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
    assert 0 < len(shape.triangles) <= 3 * FEW_TRIANGLES
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


def test_of_a_large_mesh_few_triangles_stay_near_it():
    """A sphere of 100 000 triangles keeps at most a tenth of them, has no holes, and stays as large."""
    mesh = bmesh.new()
    bmesh.ops.create_uvsphere(mesh, u_segments=320, v_segments=160, radius=1.0)
    mesh.verts.index_update()
    sphere = np.array([vertex.co for vertex in mesh.verts])
    triangles = np.array([[loop.vert.index for loop in loops] for loops in mesh.calc_loop_triangles()])
    kept, few = fewer_triangles(sphere, triangles)
    assert 1000 < len(few) <= FEW_TRIANGLES
    corners = sphere[kept][few]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(4.0 * np.pi, rel=0.1)


def test_those_next_to_the_frame_are_shown_and_fade(scene):
    settings = scene.rigid_motion_overlay
    settings.ghosts_before, settings.ghosts_after = 2, 3
    fade = fades(np.arange(0.0, 60.0, 5.0), 20.0, settings)
    assert np.flatnonzero(fade).tolist() == [2, 3, 5, 6, 7]
    assert fade[[3, 5]].tolist() == [1.0, 1.0]
    assert (np.diff(fade[5:8]) < 0.0).all()
    assert fade[2] < fade[3]
    settings.ghosts_before = 0
    assert np.flatnonzero(fades(np.arange(0.0, 60.0, 5.0), 20.0, settings)).tolist() == [5, 6, 7]


def test_they_never_fill_the_view():
    fade = np.linspace(0.2, 1.0, 12)
    assert thinned_out(fade, np.full(12, 0.01)).tolist() == fade.tolist()
    large = thinned_out(fade, np.full(12, 0.4))
    assert np.count_nonzero(large) <= 4
    assert (large * 0.4).sum() <= 0.4
    assert (thinned_out(fade, np.ones(12)) * 1.0).sum() <= 0.4


def test_what_a_box_covers_is_what_is_seen_of_it():
    box = box_of(np.array(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))))
    shifted = np.tile(np.eye(4), (3, 1, 1))
    shifted[1, 0, 3], shifted[2, 3, 3] = 0.75, -1.0
    assert covered_by(box, shifted).tolist() == pytest.approx([0.25, 0.1875, 1.0])  # whole, cut off, behind the viewer


def test_meshes_of_an_armature_are_seen_and_forgotten_when_their_keys_change(scene):
    rig, body = skinned()
    settings = scene.rigid_motion_overlay
    settings.show_ghosts, settings.ghost_step = True, 10
    scene.frame_start, scene.frame_end = 1, 40
    for frame in range(1, 41):
        scene.frame_set(frame)
    ((at, seen, frames),) = seen_bodies(bpy.context)
    assert at == rig
    assert frames.tolist() == [10.0, 20.0, 30.0, 40.0]
    assert sorted(seen.places) == frames.tolist()
    for frame, places in seen.places.items():
        scene.frame_set(int(frame))
        evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        expected = [evaluated.matrix_world @ vertex.co for vertex in evaluated.data.vertices]
        assert places == pytest.approx(np.array(expected)[seen.kept], abs=1e-5)
    # An unkeyed change of the pose changes nothing.
    rig.pose.bones["Hand"].rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    assert len(list(seen_bodies(bpy.context))) == 1
    rig.pose.bones["Hand"].keyframe_insert("rotation_quaternion", frame=15)
    bpy.context.view_layer.update()
    assert not list(seen_bodies(bpy.context))
    scene.frame_set(20)
    ((_, seen, _),) = seen_bodies(bpy.context)
    assert list(seen.places) == [20.0]
    body.data.vertices[0].co.x += 1.0
    body.data.update()
    bpy.context.view_layer.update()
    assert not list(seen_bodies(bpy.context))


def skinned() -> tuple[bpy.types.Object, bpy.types.Object]:
    """Return a rig whose hand swings, and a mesh that it deforms."""
    rig = new_rig()
    set_mode(key_bone(rig.pose.bones["Hand"]), "dq_sclerp")
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    body = new_object("Body", data=mesh)
    body.modifiers.new("Armature", "ARMATURE").object = rig
    body.vertex_groups.new(name="Hand").add([0, 1, 2, 3], 1.0, "REPLACE")
    select_bones(rig, "Hand")
    return rig, body
