"""Small cases of everyday edits of bones, each of which went wrong once."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, problem_of, set_mode
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import (
    ARM,
    PLAYED,
    key_bone,
    moving_rig,
    new_rig,
    own_constraints,
    with_edit_bones,
    write_bone,
)
from tests.animation.oracle import curves_of, expected_bases
from tests.animation.scenes import key, new_object, push_down


def keyed_body(frames: tuple[float, ...]) -> bpy.types.PoseBone:
    """The only bone of a rig, with keys on these frames."""
    return key_bone(new_rig("Rig", ARM[:1]).pose.bones[0], frames)


def frame_range(bone: bpy.types.PoseBone) -> tuple[float, float]:
    return tuple(bone.id_data.animation_data.action.frame_range)


def test_an_action_that_ends_before_frame_0_ends_with_its_keys(live_file):
    bone = keyed_body((-59.0, -47.0, -23.0))
    set_mode(bone, "dq_sclerp")
    assert frame_range(bone) == (-59.0, -23.0)


def test_an_action_that_goes_on_behind_its_keys_begins_and_ends_with_them(live_file):
    bone = keyed_body((11.0, 20.0, 30.0))
    live_file.scene.frame_end = 50
    curves_of(bone)["location", 0].extrapolation = "LINEAR"
    set_mode(bone, "dq_sclerp")
    assert frame_range(bone) == (11.0, 30.0)


def test_the_frame_range_of_an_action_follows_keys_of_a_bone_without_a_mode(live_file):
    rig = new_rig("Rig", ARM[:2])
    for bone in rig.pose.bones:
        key_bone(bone, (-19.0, -7.0, 17.0))
    body, upper = rig.pose.bones
    set_mode(upper, "dq_sclerp")
    fcurve = curves_of(body)["location", 0]
    fcurve.keyframe_points[-1].co_ui.x = 23.0
    fcurve.update()
    bpy.context.view_layer.update()
    assert frame_range(body) == (-19.0, 23.0)


def test_the_frame_range_of_an_action_is_that_of_its_keys_when_those_that_samples_lay_within_go(live_file):
    rig = new_rig("Rig", ARM[:2])
    body, upper = rig.pose.bones
    key_bone(body, (-19.0, 44.0))
    key_bone(upper, (-19.0, -7.0, 17.0))
    set_mode(upper, "dq_sclerp")
    assert frame_range(body) == (-19.0, 44.0)
    for fcurve in curves_of(body).values():
        fcurve.keyframe_points.remove(fcurve.keyframe_points[-1])
    bpy.context.view_layer.update()
    assert frame_range(body) == (-19.0, 17.0)


@pytest.mark.parametrize("carrier", ["object", "bone"])
def test_a_mode_that_is_keyed_before_anything_else_changes_nothing(live_file, carrier):
    owner = new_object() if carrier == "object" else new_rig("Rig", ARM[:1])
    moved = owner if carrier == "object" else owner.pose.bones[0]
    path = f"{moved.path_from_id()}." if carrier == "bone" else ""
    moved.rigid_motion.mode = "dq_sclerp"
    owner.keyframe_insert(f"{path}rigid_motion.mode", frame=1)
    bpy.context.view_layer.update()
    assert problem_of(moved) == ""
    moved.keyframe_insert("location", frame=1)
    moved.keyframe_insert("rotation_euler", frame=1)
    bpy.context.view_layer.update()
    assert problem_of(moved) == ""


def duplicate_hand(edit_bones: bpy.types.ArmatureEditBones) -> None:
    for bone in edit_bones:
        bone.select = bone.select_head = bone.select_tail = bone.name == "Hand"
    bpy.ops.armature.duplicate()
    bpy.context.view_layer.update()


def test_a_bone_that_is_duplicated_rests_and_has_no_constraint_of_the_first(live_file):
    rig = moving_rig("dq_sclerp")
    with_edit_bones(rig, duplicate_hand)
    bpy.context.view_layer.update()
    assert len(rig.pose.bones["Hand"].constraints) == 1
    assert len(rig.pose.bones["Hand.001"].constraints) == 0
    assert rig.pose.bones["Hand.001"].rigid_motion.mode == "BLENDER"
    assert_posed(rig, PLAYED)


def slide(bone: bpy.types.PoseBone) -> None:
    """Key it along a straight line, at an even pace: all modes move it as Blender does."""
    write_bone(bone, "location", np.array((1.0, 21.0, 40.0)), np.array(((0.0,) * 3, (1.0,) * 3, (1.95,) * 3)))


def test_an_action_whose_mode_has_nothing_to_add_takes_the_constraint_of_the_one_before_off(live_file):
    rig = new_rig("Rig", ARM[:1])
    body = rig.pose.bones["Body"]
    slide(body)
    set_mode(body, "dq_sclerp")
    bpy.context.view_layer.update()
    sliding = rig.animation_data.action
    assert len(body.constraints) == 0
    rig.animation_data.action = None
    key_bone(body)
    set_mode(body, "dq_sclerp")
    live_file.scene.frame_set(17)
    assert len(body.constraints) == 1
    rig.animation_data.action = sliding
    bpy.context.view_layer.update()
    assert len(body.constraints) == 0
    assert_posed(rig, PLAYED)


@pytest.mark.parametrize("carrier", ["object", "bone"])
def test_what_is_baked_in_place_of_a_muted_channel_is_to_be_seen(live_file, carrier):
    if carrier == "object":
        moved = key(new_object())
        set_mode(moved, "dq_sclerp")
    else:
        moved = moving_rig("dq_sclerp").pose.bones["Hand"]
    muted = curves_of(moved)["location", 1]
    muted.mute = True
    bpy.context.view_layer.update()
    wanted = expected_bases(moved, PLAYED)
    bake(moved)
    bpy.context.view_layer.update()
    assert np.abs(expected_bases(moved, PLAYED) - wanted).max() < 1e-5


def pushed_down(bone: bpy.types.PoseBone) -> None:
    push_down(bone.id_data)


def turned_by_axis_and_angle_and_back(bone: bpy.types.PoseBone) -> None:
    for mode in ("AXIS_ANGLE", "QUATERNION"):
        bone.rotation_mode = mode
        bpy.context.view_layer.update()


def given_blenders_in_betweens_and_back(bone: bpy.types.PoseBone) -> None:
    for mode in ("BLENDER", "dq_sclerp"):
        set_mode(bone, mode)
        bpy.context.view_layer.update()


@pytest.mark.parametrize(
    "deed",
    [pushed_down, turned_by_axis_and_angle_and_back, given_blenders_in_betweens_and_back],
    ids=lambda deed: deed.__name__,
)
def test_keys_on_the_influence_of_a_constraint_stay_when_its_bone_is(live_file, deed):
    bone = moving_rig().pose.bones["Lower"]
    (constraint,) = own_constraints(bone.id_data)["Lower"]
    for frame, influence in ((1, 0.0), (40, 1.0)):
        constraint.influence = influence
        constraint.keyframe_insert("influence", frame=frame)
    action = bone.id_data.animation_data.action
    deed(bone)
    bpy.context.view_layer.update()
    fcurves = action.layers[0].strips[0].channelbags[0].fcurves
    (influence,) = [fcurve for fcurve in fcurves if fcurve.data_path.endswith("influence")]
    assert [tuple(point.co) for point in influence.keyframe_points] == [(1.0, 0.0), (40.0, 1.0)]
