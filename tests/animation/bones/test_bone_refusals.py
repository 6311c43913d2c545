"""Where a bone cannot have a mode it is refused: the message names rig, bone and way out, and nothing changes."""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of, refresh
from tests.animation.actions.test_refusals import HINDRANCES
from tests.animation.bones.poses import assert_posed, shown_poses
from tests.animation.bones.rigs import PLAYED, moving_rig
from tests.animation.keyed import curves_of


@pytest.mark.parametrize("hindrance", ["noise", "all driven", "sampled keys"])
def test_what_comes_in_the_way_later_gives_blenders_own_motion_and_a_reason(live_file, hindrance):
    rig = moving_rig(scale="even")
    lower = rig.pose.bones["Lower"]
    hinder, message = HINDRANCES[hindrance]
    hinder(lower)
    bpy.context.view_layer.update()
    refresh()
    shown = shown_poses([rig], PLAYED)[0]
    assert re.match(f"Rig.*Lower.*{message}", problem_of(lower))
    for constraint in list(lower.constraints):
        lower.constraints.remove(constraint)
    bpy.context.view_layer.update()
    native = shown_poses([rig], PLAYED)[0]
    assert all(np.array_equal(shown[name], native[name], equal_nan=True) for name in shown)
    assert_posed(rig, PLAYED, ["Body", "Upper"])


@pytest.mark.parametrize("hindrance", ["noise", "all driven", "axis and angle", "cycles in part"])
def test_in_betweens_are_back_as_soon_as_nothing_is_in_the_way_any_more(live_file, hindrance):
    rig = moving_rig()
    lower = rig.pose.bones["Lower"]
    HINDRANCES[hindrance][0](lower)
    bpy.context.view_layer.update()
    assert problem_of(lower) != ""
    for (path, _), fcurve in curves_of(lower).items():
        for added in list(fcurve.modifiers):
            if path == "location":
                fcurve.modifiers.remove(added)
    for driven in list(rig.animation_data.drivers):
        rig.driver_remove(driven.data_path, driven.array_index)
    lower.rotation_mode = "QUATERNION"
    bpy.context.view_layer.update()
    assert problem_of(lower) == ""
    assert_posed(rig, PLAYED)


def test_rotation_orders_that_change_between_bones_of_one_slot_are_told(live_file):
    rig = moving_rig()
    copy = rig.copy()
    bpy.context.scene.collection.objects.link(copy)
    copy.pose.bones["Hand"].rotation_mode = "XYZ"
    bpy.context.view_layer.update()
    refresh()
    assert_posed(rig, PLAYED)
    assert re.search("moves by the same Action slot as", problem_of(copy.pose.bones["Hand"]))
