"""Paths of what parents, holders and offset layers move: where Blender shows it on every frame, or none."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import add_layer, hold_in, set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay import cache
from rigid_motion.ui.overlay.cache import path_of
from rigid_motion.ui.overlay.parents import maps_of
from rigid_motion.ui.overlay.points import PASSING_HOLDER
from tests.animation.bones.rigs import in_turn
from tests.animation.held import worlds
from tests.animation.keyed import curves_of
from tests.animation.layered import key_base, key_influence, key_offset, new
from tests.animation.scenes import give_own_deltas, key, new_object
from tests.ui.overlay.seen import assert_where_it_is_seen
from tests.ui.rigs import FRAMES, key_bone, new_rig


@pytest.fixture
def table(scene) -> bpy.types.Object:
    """A parent that moves in a mode, scaled unevenly, on another one that moves as well."""
    table, floor = key(new_object("Table"), FRAMES, seed=1, scale="uneven"), key(new_object("Floor"), FRAMES, seed=2)
    give_own_deltas(floor)
    table.parent = floor
    set_mode([table, floor], "dq_sclerp")
    return table


@pytest.mark.parametrize("connected", [False, True])
def test_an_object_on_a_bone_that_moves(scene, table, connected):
    rig = new_rig(use_connect=connected)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.parent = table
    for name in ("Hip", "Hand"):
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    obj = key(new_object("Sword"), FRAMES)
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "Hand"
    set_mode(obj, "motor_spline")
    assert assert_where_it_is_seen(obj, scene).in_world


OTHERS = {
    "constrained": lambda table: table.constraints.new("LIMIT_LOCATION"),
    "driven": lambda table: table.driver_add("location", 0),
    "in strips": lambda table: table.animation_data.nla_tracks.new().strips.new(
        "Strip", 1, table.animation_data.action
    ),
}


@pytest.mark.parametrize("other", OTHERS)
def test_parents_that_do_not_move_by_keys_alone_are_as_they_are_now(scene, table, other):
    obj = key(new_object(), FRAMES)
    obj.parent = table
    assert path_of(obj, bpy.context).in_world
    OTHERS[other](table)
    bpy.context.view_layer.update()
    assert not path_of(obj, bpy.context).in_world


EDITS = {
    "key": lambda table: setattr(curves_of(table)["location", 0].keyframe_points[1].co, "y", 5.0),
    "order": lambda table: setattr(table.parent, "rotation_mode", "ZYX"),
    "turn": lambda table: setattr(table.parent, "rotation_euler", (0.2, 0.0, 0.1)),
    "delta": lambda table: setattr(table.parent, "delta_location", (1.0, 2.0, 3.0)),
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_path_follows_edits_of_its_parents_and_of_what_they_stand_on(scene, edit):
    table, floor, obj = key(new_object("Table"), FRAMES), new_object("Floor", "XYZ"), key(new_object(), FRAMES)
    table.parent, obj.parent, floor.rotation_euler = floor, table, (0.5, 0.9, -0.4)
    set_mode([table, obj], "dq_sclerp")
    bpy.context.view_layer.update()
    path_of(obj, bpy.context)
    EDITS[edit](table)
    bpy.context.view_layer.update()
    assert assert_where_it_is_seen(obj, scene).in_world


def passed_around(prop, holders):
    """Hold a prop in one holder after the other from frame 8 on, some of them over several frames, and let it go."""
    for frame, holder, frames in zip((8, 18, 27, 36), (*holders, holders[0], None), (0, 5, None, 3), strict=True):
        bpy.context.scene.frame_set(frame)
        hold_in(prop, holder, frames=frames)


@pytest.fixture
def hands(scene):
    left, right = (key(new_object(name), FRAMES, seed=seed) for seed, name in enumerate(("Left", "Right")))
    set_mode([left, right], "motor_spline")
    return left, right


@pytest.mark.parametrize("parented", [False, True])
def test_an_object_in_a_bone_and_in_a_hand_that_move_by_keys(scene, hands, parented):
    prop, rig = new_object("Prop"), new_rig()
    for name in ("Hip", "Hand"):
        key_bone(rig.pose.bones[name])
    prop.location = (0.3, 0.2, 0.1)
    if parented:
        prop.parent = key(new_object("Floor"), FRAMES, seed=7)
    passed_around(prop, (rig.pose.bones["Hand"], hands[1]))
    path = assert_where_it_is_seen(prop, scene)
    assert [piece.holder for piece in path.pieces] == [0, 1, PASSING_HOLDER, 2, PASSING_HOLDER, 1, PASSING_HOLDER]
    assert [piece.last for piece in path.pieces[:-1]] == [piece.first for piece in path.pieces[1:]]


def test_what_is_held_last_goes_on_to_the_end_of_the_scene(scene, hands):
    scene.frame_end = 41
    prop = new_object("Prop")
    scene.frame_set(8)
    hold_in(prop, hands[0])
    path = assert_where_it_is_seen(prop, scene)
    assert path.frames[[0, -1]].tolist() == [7.0, 41.0]


def test_a_bone_in_hands(scene, hands):
    rig = new_rig()
    key_bone(rig.pose.bones["Hip"])
    passed_around(rig.pose.bones["Hand"], hands)
    assert_where_it_is_seen(rig.pose.bones["Hand"], scene)


def test_an_edit_of_the_hand_moves_the_path(scene, hands):
    prop = new_object("Prop")
    passed_around(prop, hands)
    before = path_of(prop, bpy.context)
    for point in curves_of(hands[0])["location", 2].keyframe_points:
        point.co.y += 1.0
    bpy.context.view_layer.update()
    path = assert_where_it_is_seen(prop, scene)
    assert np.abs(path.desired - before.desired).max() > 0.5
    assert path_of(prop, bpy.context) is path


def test_a_hand_that_follows_is_known_where_it_was_seen(scene, hands):
    follower = new_object("Follower")
    follower.constraints.new("COPY_TRANSFORMS").target = hands[0]
    prop = new_object("Prop")
    passed_around(prop, (follower, hands[1]))
    before = path_of(prop, bpy.context)
    scene.frame_end = 41
    bpy.ops.rigid_motion.update_path()
    assert scene.frame_current == 36
    assert np.abs(path_of(prop, bpy.context).desired - before.desired).max() > 0.1
    assert_where_it_is_seen(prop, scene)
    for point in curves_of(hands[0])["location", 2].keyframe_points:
        point.co.y += 1.0
    bpy.context.view_layer.update()
    assert_where_it_is_seen(prop, scene)


def test_after_an_undo_all_is_looked_at_anew(scene, hands):
    follower = new_object("Follower")
    follower.constraints.new("COPY_TRANSFORMS").target = hands[0]
    passed_around(new_object("Prop"), (follower, hands[1]))
    bpy.ops.rigid_motion.update_path()
    bpy.ops.ed.undo_push(message="Held")
    before = path_of(bpy.data.objects["Prop"], bpy.context)
    hands[0].location.z += 1.0
    bpy.ops.ed.undo_push(message="Moved")
    bpy.ops.ed.undo()
    path = path_of(bpy.data.objects["Prop"], bpy.context)
    assert path is not before
    assert path.desired == pytest.approx(before.desired, abs=1e-5)


BASE_FRAMES = np.arange(1, 41)


@pytest.mark.parametrize(
    ("kind", "modes"),
    in_turn(
        ("object", "child", "on a bone", "root", "bone"), (("dq_sclerp", "motor_spline"), ("motor_spline", "BLENDER"))
    ),
)
def test_a_path_is_where_it_is_seen_from_the_first_to_the_last_key_of_the_base(extension, kind, modes):
    carrier = key_base(new(kind, "XYZ"), modes[0])
    bpy.context.scene.frame_set(1)
    add_layer(carrier)
    key_offset(carrier, modes[1], frames=(1.0, 15.0, 33.0))
    bpy.context.view_layer.update()
    seen = worlds(carrier, BASE_FRAMES)[:, :3, 3]
    ((space, path),) = cache.drawn_paths([transform_of(carrier)], bpy.context)
    assert path.in_world or kind == "object"
    assert (path.frames[0], path.frames[-1]) == (1.0, 40.0)
    drawn = np.stack([np.interp(BASE_FRAMES, path.frames, column) for column in path.line.T], axis=1)
    assert np.abs(maps_of(space).at(drawn) - seen).max() < 2e-3


def test_where_the_influence_is_not_one_or_the_strip_is_left_there_is_no_path(extension):
    tool = key_base(new("object", "XYZ"), "dq_sclerp")
    add_layer(tool)
    key_offset(tool)
    key_influence(tool, (1.0, 1.0), (20.0, 0.5))
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is None
    key_influence(tool, (1.0, 1.0))
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is not None
    tool.animation_data.use_tweak_mode = False
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is None
    assert cache.path_of(transform_of(tool).motion.base, bpy.context) is not None
