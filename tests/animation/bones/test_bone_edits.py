"""Edits of bones show at once; those of all kinds, in any order, `test_bone_states` tries."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses
from tests.animation.bones.rigs import (
    FRAMES,
    PLAYED,
    in_turn,
    moving_rig,
    own_constraints,
    with_edit_bones,
    write_bone,
)
from tests.animation.keyed import curves_of

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
    "a mode": lambda rig: set_mode(list(rig.pose.bones), "pga_lerp"),
}


@pytest.mark.parametrize(("edit", "mode"), in_turn(EDITS, ["dq_sclerp", "motor_spline"]))
def test_an_edit_shows_at_once_on_the_frame_that_is_shown(live_file, edit, mode):
    rig = moving_rig(mode)
    live_file.scene.frame_set(17)
    EDITS[edit](rig)
    bpy.context.view_layer.update()
    graph = live_file.evaluated_depsgraph_get()
    at_once = {bone.name: np.array(bone.matrix)[None] for bone in rig.evaluated_get(graph).pose.bones}
    frame = np.array((17.0,))
    assert_same_poses(rig, frame, at_once, expected_poses(rig, frame))
    assert_posed(rig, np.arange(-23.0, 65.0))
    assert refresh() == 0


def test_constraints_that_are_copied_to_another_bone_make_no_second_motion(live_file):
    rig = moving_rig()
    hand = rig.pose.bones["Hand"]
    hand.constraints.copy(own_constraints(rig)["Lower"][0])
    bpy.context.view_layer.update()
    refresh()
    assert_posed(rig, PLAYED)
