"""Under parents that move by keys, paths are in the world, as Blender shows it on every frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay.cache import path_of, paths_of
from rigid_motion.ui.overlay.kinds import space_of_bone
from tests.animation.keyed import curves_of
from tests.animation.scenes import give_own_deltas, key, new_object
from tests.ui.rigs import FRAMES, key_bone, new_rig

WHOLE = np.arange(FRAMES[0], FRAMES[-1] + 1.0)


def shown(carrier, point=(0.0, 0.0, 0.0)):
    """Where Blender shows a point of an object or a bone in the world, on all whole frames."""
    result = []
    for frame in WHOLE:
        bpy.context.scene.frame_set(int(frame))
        if isinstance(carrier, bpy.types.PoseBone):
            rig = carrier.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
            matrix = rig.matrix_world @ rig.pose.bones[carrier.name].matrix
        else:
            matrix = carrier.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
        result.append((np.array(matrix) @ (*point, 1.0))[:3])
    return np.array(result)


def path_under(bone):
    target = transform_of(bone)
    _, turned = space_of_bone(bone, bpy.context.evaluated_depsgraph_get())
    return paths_of([target], bpy.context.scene, {target: turned})[0]


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
    rig = new_rig()
    if connected:
        bpy.ops.object.mode_set(mode="EDIT")
        rig.data.edit_bones["Hand"].use_connect = True
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.parent = table
    for name in ("Hip", "Hand"):
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    obj = key(new_object("Sword"), FRAMES)
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "Hand"
    set_mode(obj, "motor_spline")
    assert_in_world(path_of(obj, scene), shown(obj))


def _plain(bone):
    pass


def _no_local_location(bone):
    bone.use_local_location = False


def _no_inherited_rotation(bone):
    bone.use_inherit_rotation = False


def _no_inherited_scale(bone):
    bone.inherit_scale = "NONE"


SETTINGS = pytest.mark.parametrize("setting", [_plain, _no_local_location, _no_inherited_rotation, _no_inherited_scale])


@SETTINGS
@pytest.mark.parametrize("moves", [False, True])
def test_a_bone_under_bones_that_move(scene, setting, moves):
    rig = new_rig()
    setting(rig.data.bones["Hand"])
    for name in ("Hip", "Arm"):
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    paths = ("location", "rotation_quaternion") if moves else ("rotation_quaternion",)
    hand = key_bone(rig.pose.bones["Hand"], paths=paths)
    set_mode(hand, "motor_spline")
    point = (0.0, 0.0, 0.0) if moves else (0.0, hand.bone.length, 0.0)
    assert_in_world(path_under(hand), shown(hand, point))


def constrained(table):
    table.constraints.new("LIMIT_LOCATION")


def driven(table):
    table.driver_add("location", 0)


def in_strips(table):
    data = table.animation_data
    data.nla_tracks.new().strips.new("Strip", 1, data.action)


@pytest.mark.parametrize("other", [constrained, driven, in_strips])
def test_parents_that_do_not_move_by_keys_alone_are_as_they_are_now(scene, table, other):
    obj = key(new_object(), FRAMES)
    obj.parent = table
    assert path_of(obj, scene).in_world
    other(table)
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
