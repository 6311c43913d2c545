"""Under parents that move by keys, paths are in the world, as Blender shows it on every frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.ui.overlay.cache import path_of
from tests.animation.bones.poses import shown_poses
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import give_own_deltas, key, new_object
from tests.ui.rigs import FRAMES, key_bone, new_rig, path_and_space

WHOLE = np.arange(FRAMES[0], FRAMES[-1] + 1.0)


def shown(carrier, point=(0.0, 0.0, 0.0)):
    """Where Blender shows a point of an object or a bone in the world, on all whole frames."""
    matrices = shown_worlds([carrier.id_data], WHOLE)[0]
    if isinstance(carrier, bpy.types.PoseBone):
        matrices = matrices @ shown_poses([carrier.id_data], WHOLE)[0][carrier.name]
    return (matrices @ (*point, 1.0))[:, :3]


def assert_in_world(path, expected):
    assert path.in_world
    on = np.searchsorted(path.frames, WHOLE)
    assert path.desired[on] == pytest.approx(expected, abs=3e-5)


@pytest.fixture
def table(scene) -> bpy.types.Object:
    """A parent that moves by a mode, scaled unevenly, on one that moves as well."""
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
    assert_in_world(path_of(obj, scene), shown(obj))


SETTINGS = pytest.mark.parametrize(
    "setting",
    [{}, {"use_local_location": False}, {"use_inherit_rotation": False}, {"inherit_scale": "NONE"}],
    ids=str,
)


@SETTINGS
@pytest.mark.parametrize("moves", [False, True])
def test_a_bone_under_bones_that_move(scene, setting, moves):
    rig = new_rig(**setting)
    for name in ("Hip", "Arm"):
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    hand = key_bone(rig.pose.bones["Hand"], location=moves)
    set_mode(hand, "motor_spline")
    point = (0.0, 0.0, 0.0) if moves else (0.0, hand.bone.length, 0.0)
    assert_in_world(path_and_space(hand)[0], shown(hand, point))


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
    assert path_of(obj, scene).in_world
    OTHERS[other](table)
    bpy.context.view_layer.update()
    assert not path_of(obj, scene).in_world


def test_a_path_follows_edits_of_its_parents(scene, table):
    obj = key(new_object(), FRAMES)
    obj.parent = table
    before = path_of(obj, scene)
    scene.frame_set(20)
    assert path_of(obj, scene) is before
    curves_of(table)["location", 0].keyframe_points[1].co.y += 1.0
    bpy.context.view_layer.update()
    after = path_of(obj, scene)
    assert after is not before
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    assert_in_world(path_of(obj, scene), shown(obj))
