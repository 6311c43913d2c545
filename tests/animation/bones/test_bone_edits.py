"""Edits of keys, baking, and what is done to constraints: bones show at once what their keys and modes say."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, problem_of, refresh, set_mode, unbake
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import (
    ARM,
    FRAMES,
    PLAYED,
    Rest,
    key_all,
    key_bone,
    moving_rig,
    new_rig,
    own_constraints,
    select_only,
    with_edit_bones,
    write_bone,
)
from tests.animation.oracle import curves_of, expected_bases, key_frames, snapshot
from tests.animation.scenes import key, new_object

Edit = Callable[[bpy.types.Object], None]


def change_a_value(rig: bpy.types.Object) -> None:
    curves_of(rig.pose.bones["Lower"])["location", 1].keyframe_points[1].co_ui.y += 1.0


def change_a_frame(rig: bpy.types.Object) -> None:
    for (path, _), fcurve in curves_of(rig.pose.bones["Lower"]).items():
        if path in ("location", "rotation_quaternion"):
            fcurve.keyframe_points[1].co_ui.x = 15.0
            fcurve.update()


def insert_a_key(rig: bpy.types.Object) -> None:
    rig.pose.bones["Lower"].location = (0.5, 0.1, -0.3)
    rig.pose.bones["Lower"].keyframe_insert("location", frame=30)


def delete_a_key(rig: bpy.types.Object) -> None:
    for path in ("location", "rotation_quaternion"):
        rig.pose.bones["Lower"].keyframe_delete(path, frame=11)


def delete_a_channel(rig: bpy.types.Object) -> None:
    channelbag = rig.animation_data.action.layers[0].strips[0].channelbag(rig.animation_data.action_slot)
    channelbag.fcurves.remove(curves_of(rig.pose.bones["Lower"])["location", 2])


def add_a_key_after_the_last(rig: bpy.types.Object) -> None:
    for path in ("location", "rotation_quaternion"):
        rig.pose.bones["Lower"].keyframe_insert(path, frame=60)


def add_a_key_before_the_first(rig: bpy.types.Object) -> None:
    for path in ("location", "rotation_quaternion"):
        rig.pose.bones["Lower"].keyframe_insert(path, frame=-20)


def turn_by_angles(rig: bpy.types.Object) -> None:
    rig.pose.bones["Lower"].rotation_mode = "ZXY"
    key_bone(rig.pose.bones["Lower"], seed=8)


def mute_a_channel(rig: bpy.types.Object) -> None:
    curves_of(rig.pose.bones["Lower"])["location", 2].mute = True


def key_scale(rig: bpy.types.Object) -> None:
    write_bone(rig.pose.bones["Lower"], "scale", np.array(FRAMES), np.array(((1.0,) * 3, (2.0,) * 3) * 2))


def connect(rig: bpy.types.Object) -> None:
    with_edit_bones(rig, lambda edit_bones: setattr(edit_bones["Lower"], "use_connect", True))


def ease(rig: bpy.types.Object) -> None:
    for fcurve in curves_of(rig.pose.bones["Lower"]).values():
        if len(fcurve.keyframe_points):
            fcurve.keyframe_points[0].interpolation = "BOUNCE"


EDITS: dict[str, Edit] = {
    "a value": change_a_value,
    "a frame": change_a_frame,
    "an insertion": insert_a_key,
    "a deletion": delete_a_key,
    "a channel less": delete_a_channel,
    "a later end": add_a_key_after_the_last,
    "an earlier beginning": add_a_key_before_the_first,
    "a rotation mode": turn_by_angles,
    "a muted channel": mute_a_channel,
    "scale": key_scale,
    "a connection": connect,
    "an easing": ease,
}


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_an_edit_shows_at_once_and_on_the_frame_that_is_shown(live_file, edit: Edit, mode):
    rig = moving_rig(mode)
    live_file.scene.frame_set(17)
    edit(rig)
    bpy.context.view_layer.update()
    graph = live_file.evaluated_depsgraph_get()
    at_once = {bone.name: np.array(bone.matrix)[None] for bone in rig.evaluated_get(graph).pose.bones}
    frame = np.array((17.0,))
    assert_same_poses(rig, frame, at_once, expected_poses(rig, frame))
    assert_posed(rig, np.arange(-23.0, 65.0))
    assert refresh() == 0


def test_a_mode_is_to_be_seen_on_the_frame_that_is_shown_when_it_is_chosen(live_file):
    rig = key_all(new_rig())
    live_file.scene.frame_set(17)
    frame = np.array((17.0,))
    for mode in ("dq_sclerp", "pga_lerp", "BLENDER", "motor_spline"):
        set_mode(list(rig.pose.bones), mode)
        bpy.context.view_layer.update()
        evaluated = rig.evaluated_get(live_file.evaluated_depsgraph_get())
        at_once = {bone.name: np.array(bone.matrix)[None] for bone in evaluated.pose.bones}
        assert_same_poses(rig, frame, at_once, expected_poses(rig, frame))


def test_a_key_inserted_in_between_keeps_the_pose_on_the_screen(live_file):
    rig = moving_rig()
    live_file.scene.frame_set(17)
    frame = np.array((17.0,))
    wanted = expected_poses(rig, frame)
    for pose_bone in rig.pose.bones:
        for path in ("location", "rotation_quaternion"):
            assert pose_bone.keyframe_insert(path)
    bpy.context.view_layer.update()
    assert_same_poses(rig, frame, shown_poses([rig], frame)[0], wanted)
    assert_posed(rig, PLAYED)


def test_un_baking_one_bone_leaves_the_others_alone(live_file):
    rig = moving_rig()
    keys = {bone.name: snapshot(bone) for bone in rig.pose.bones}
    wanted = expected_poses(rig, PLAYED)
    bake(list(rig.pose.bones))
    baked = {bone.name: snapshot(bone) for bone in rig.pose.bones}
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], wanted)
    assert not any(own_constraints(rig).values())
    unbake(rig.pose.bones["Lower"])
    assert {bone.name: is_baked(bone) for bone in rig.pose.bones} == {rest.name: rest.name != "Lower" for rest in ARM}
    assert snapshot(rig.pose.bones["Lower"]) == keys["Lower"]
    assert all(snapshot(rig.pose.bones[name]) == baked[name] for name in ("Body", "Upper", "Hand"))
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], wanted)
    unbake([rig.pose.bones[name] for name in ("Body", "Upper", "Hand")])
    assert {bone.name: snapshot(bone) for bone in rig.pose.bones} == keys
    assert_posed(rig, PLAYED)


def test_baking_one_bone_leaves_the_others_alone(live_file):
    rig = moving_rig()
    wanted = expected_poses(rig, PLAYED)
    others = {name: snapshot(rig.pose.bones[name]) for name in ("Body", "Upper", "Hand")}
    bake(rig.pose.bones["Lower"])
    assert {name: snapshot(rig.pose.bones[name]) for name in others} == others
    assert [len(held) for held in own_constraints(rig).values()] == [1, 1, 0, 1]
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], wanted)


def native_poses(rig: bpy.types.Object, without: str) -> dict[str, np.ndarray]:
    """Where all bones have to be when one of them moves as Blender has it."""
    bases = {without: expected_bases(rig.pose.bones[without], PLAYED, keys=np.empty(0))}
    return expected_poses(rig, PLAYED, bases)


def test_a_muted_constraint_shows_blenders_own_motion_and_stays_muted(live_file):
    rig = moving_rig()
    (constraint,) = own_constraints(rig)["Lower"]
    constraint.mute = True
    bpy.context.view_layer.update()
    wanted = native_poses(rig, "Lower")
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], wanted)
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += 1.0
    change_a_value(rig)
    bpy.context.view_layer.update()
    refresh()
    assert own_constraints(rig)["Lower"][0].mute
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], native_poses(rig, "Lower"))
    own_constraints(rig)["Lower"][0].mute = False
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)


def test_a_removed_constraint_stays_away_until_a_mode_is_chosen_anew(live_file):
    rig = moving_rig()
    lower = rig.pose.bones["Lower"]
    lower.constraints.remove(own_constraints(rig)["Lower"][0])
    bpy.context.view_layer.update()
    change_a_value(rig)
    bpy.context.view_layer.update()
    refresh()
    assert own_constraints(rig)["Lower"] == []
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], native_poses(rig, "Lower"))
    set_mode(lower, "BLENDER")
    set_mode(lower, "dq_sclerp")
    assert problem_of(lower) == ""
    assert_posed(rig, PLAYED)


def test_a_constraint_that_is_moved_down_does_not_break_the_motion(live_file):
    rig = moving_rig()
    hand = rig.pose.bones["Hand"]
    hand.constraints.new("COPY_SCALE").mute = True
    hand.constraints.move(0, 1)
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)
    change_a_value(rig)
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)
    assert len(own_constraints(rig)["Hand"]) == 1


def test_constraints_that_are_copied_to_another_bone_make_no_second_motion(live_file):
    rig = moving_rig()
    hand = rig.pose.bones["Hand"]
    hand.constraints.copy(own_constraints(rig)["Lower"][0])
    bpy.context.view_layer.update()
    refresh()
    assert_posed(rig, PLAYED)


def test_a_pose_that_is_mirrored_by_hand_and_keyed_is_followed(live_file):
    sides = [Rest(f"Hand.{side}", (x, 0.0, 1.0), (2 * x, 0.1, 1.2)) for side, x in (("L", 0.3), ("R", -0.3))]
    rig = key_all(new_rig("Rig", sides))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    for (path, index), fcurve in curves_of(rig.pose.bones["Hand.L"]).items():
        if path not in ("location", "rotation_quaternion"):
            continue
        sign = (
            -1.0 if (path, index) in {("location", 0), ("rotation_quaternion", 2), ("rotation_quaternion", 3)} else 1.0
        )
        own = curves_of(rig.pose.bones["Hand.R"])[path, index]
        for point, other in zip(own.keyframe_points, fcurve.keyframe_points, strict=True):
            point.co_ui.y = sign * other.co_ui.y
        own.update()
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)


def test_a_flipped_pose_that_is_pasted_and_keyed_is_followed(live_file):
    sides = [Rest(f"Hand.{side}", (x, 0.0, 1.0), (2 * x, 0.1, 1.2)) for side, x in (("L", 0.3), ("R", -0.3))]
    rig = key_all(new_rig("Rig", sides))
    set_mode(rig.pose.bones["Hand.R"], "dq_sclerp")
    select_only(rig)
    bpy.ops.object.mode_set(mode="POSE")
    live_file.scene.frame_set(11)
    rig.data.bones.active = rig.data.bones["Hand.L"]
    for bone in rig.pose.bones:
        (bone if bpy.app.version >= (5, 0) else bone.bone).select = bone.name == "Hand.L"
    bpy.ops.pose.copy()
    live_file.scene.frame_set(17)
    right = rig.pose.bones["Hand.R"]
    before = np.array(right.location)
    bpy.ops.pose.paste(flipped=True)
    pasted = np.array(right.location)
    for path in ("location", "rotation_quaternion"):
        right.keyframe_insert(path)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    assert np.abs(pasted - before).max() > 0.1
    assert 17.0 in key_frames(right)
    assert_posed(rig, PLAYED)


def test_undo_and_redo_bring_back_what_was_to_be_seen(live_file):
    live_file.preferences.edit.use_global_undo = True
    rig = moving_rig()
    bpy.ops.ed.undo_push(message="dq_sclerp")
    first = shown_poses([rig], PLAYED)[0]
    set_mode(list(rig.pose.bones), "pga_lerp")
    bpy.ops.ed.undo_push(message="pga_lerp")
    second = shown_poses([rig], PLAYED)[0]
    bpy.ops.ed.undo()
    rig = bpy.data.objects["Rig"]
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], first)
    assert_posed(rig, PLAYED)
    bpy.ops.ed.redo()
    rig = bpy.data.objects["Rig"]
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], second)
    assert_posed(rig, PLAYED)


def test_an_object_beside_is_left_alone(live_file):
    rig, obj = moving_rig(), key(new_object())
    before = snapshot(obj)
    change_a_value(rig)
    bpy.context.view_layer.update()
    assert snapshot(obj) == before
    assert obj.rigid_motion.mode == "BLENDER"
