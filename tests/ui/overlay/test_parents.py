"""Paths under parents that move by keys are in the world, where Blender shows the object on every frame."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.ui.overlay.cache import path_of
from tests.animation.keyed import curves_of
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
