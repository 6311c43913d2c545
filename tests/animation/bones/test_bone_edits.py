"""Edits of keys, baking, and what is done to constraints: bones show at once what their keys and modes say."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, refresh, set_mode, unbake
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import (
    ARM,
    FRAMES,
    PLAYED,
    key_all,
    moving_rig,
    new_rig,
    own_constraints,
    with_edit_bones,
    write_bone,
)
from tests.animation.keyed import curves_of, snapshot

Edit = Callable[[bpy.types.Object], None]


def change_a_value(rig: bpy.types.Object) -> None:
    curves_of(rig.pose.bones["Lower"])["location", 1].keyframe_points[1].co_ui.y += 1.0


def delete_a_channel(rig: bpy.types.Object) -> None:
    channelbag = rig.animation_data.action.layers[0].strips[0].channelbag(rig.animation_data.action_slot)
    channelbag.fcurves.remove(curves_of(rig.pose.bones["Lower"])["location", 2])


def key_scale(rig: bpy.types.Object) -> None:
    write_bone(rig.pose.bones["Lower"], "scale", np.array(FRAMES), np.array(((1.0,) * 3, (2.0,) * 3) * 2))


def connect(rig: bpy.types.Object) -> None:
    with_edit_bones(rig, lambda edit_bones: setattr(edit_bones["Lower"], "use_connect", True))


EDITS: dict[str, Edit] = {
    "a value": change_a_value,
    "a channel less": delete_a_channel,
    "scale": key_scale,
    "a connection": connect,
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


def test_un_baking_one_bone_leaves_the_others_alone(live_file):
    rig = moving_rig()
    keys = {bone.name: snapshot(bone) for bone in rig.pose.bones}
    expected = expected_poses(rig, PLAYED)
    bake(list(rig.pose.bones))
    baked = {bone.name: snapshot(bone) for bone in rig.pose.bones}
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], expected)
    assert not any(own_constraints(rig).values())
    unbake(rig.pose.bones["Lower"])
    assert {bone.name: is_baked(bone) for bone in rig.pose.bones} == {rest.name: rest.name != "Lower" for rest in ARM}
    assert snapshot(rig.pose.bones["Lower"]) == keys["Lower"]
    assert all(snapshot(rig.pose.bones[name]) == baked[name] for name in ("Body", "Upper", "Hand"))
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], expected)
    unbake([rig.pose.bones[name] for name in ("Body", "Upper", "Hand")])
    assert {bone.name: snapshot(bone) for bone in rig.pose.bones} == keys
    assert_posed(rig, PLAYED)


def test_constraints_that_are_copied_to_another_bone_make_no_second_motion(live_file):
    rig = moving_rig()
    hand = rig.pose.bones["Hand"]
    hand.constraints.copy(own_constraints(rig)["Lower"][0])
    bpy.context.view_layer.update()
    refresh()
    assert_posed(rig, PLAYED)
