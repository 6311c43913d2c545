"""Edits of rigs: bones always show what their keys and modes say now, and nothing stale is left."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import problem_of, refresh, set_mode, set_turns
from rigid_motion.animation.actions.marks import read_marks
from tests.animation.bones.poses import assert_posed, placed
from tests.animation.bones.rigs import BETWEEN, moving_rig, with_edit_bones
from tests.animation.keyed import curves_of
from tests.animation.modified import is_term


def assert_nothing_stale() -> None:
    """Check that terms are as they would be planned now, and only on bones with a mode."""
    assert refresh() == 0
    bones = {f"{bone.path_from_id()}." for obj in bpy.data.objects if obj.pose for bone in obj.pose.bones}
    layers = [layer for action in bpy.data.actions for layer in action.layers]
    for channelbag in (bag for layer in layers for strip in layer.strips for bag in strip.channelbags):
        for bone in bones:
            curves = [fcurve for fcurve in channelbag.fcurves if fcurve.data_path.startswith(bone)]
            if any(is_term(modifier) for fcurve in curves for modifier in fcurve.modifiers):
                assert any((read_marks(fcurve) > 1).any() for fcurve in curves), f"{bone} in {channelbag.id_data.name}"


IN_EDIT_MODE: dict[str, Callable[[bpy.types.ArmatureEditBones], object]] = {
    "other rest": lambda bones: setattr(bones["Upper"], "tail", (0.1, 0.9, 1.4)),
    "another parent": lambda bones: setattr(bones["Hand"], "parent", bones["Body"]),
    "a bone more": lambda bones: setattr(bones.new("Finger"), "tail", (1.0, 0.3, 1.2)),
}


@pytest.mark.parametrize("edit", IN_EDIT_MODE)
def test_bones_keep_their_modes_and_turns_and_new_ones_rest(live_file, edit):
    rig = moving_rig()
    for name in ("Upper", "Hand"):
        # Location runs along the axes of the parent, so that rest poses matter.
        rig.data.bones[name].use_local_location = False
    set_mode(rig.pose.bones["Hand"], "pga_lerp")
    set_turns(rig.pose.bones["Upper"], 1, [1.0])
    modes = {bone.name: bone.rigid_motion.mode for bone in rig.pose.bones}
    with_edit_bones(rig, IN_EDIT_MODE[edit])
    bpy.context.view_layer.update()
    for bone in rig.pose.bones:
        assert bone.rigid_motion.mode == modes.get(bone.name, "BLENDER")
    assert {problem_of(bone) for bone in rig.pose.bones} == {""}
    assert rig.pose.bones["Upper"].rigid_motion.turns == 1
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()


def test_while_one_bone_is_keyed_poses_of_others_that_are_not_keyed_yet_stay(live_file):
    """As Auto Key does, even if the whole motion is replanned."""
    rig = moving_rig("motor_spline")
    live_file.scene.frame_set(17)
    for number, bone in enumerate(rig.pose.bones):
        bone.location.x += 0.1 * number
        bone.rotation_quaternion.rotate(Euler((0.2, 0.1 * number, 0.0)))
    posed, hand = placed(rig), rig.pose.bones["Hand"]
    for bone in (hand, *rig.pose.bones):
        for path in ("location", "rotation_quaternion"):
            bone.keyframe_insert(path, frame=17)
            np.testing.assert_allclose(placed(rig), posed, atol=1e-5, err_msg=f"{path} of {bone.name} keyed")
        if bone == hand:
            set_mode(hand, "dq_sclerp")
            curves_of(hand)["location", 0].keyframe_points[0].co_ui.y += 1.0
            np.testing.assert_allclose(placed(rig), posed, atol=1e-5)
    live_file.scene.frame_set(3)
    live_file.scene.frame_set(17)
    np.testing.assert_allclose(placed(rig), posed, atol=1e-5)
    assert_posed(rig, BETWEEN)


def test_what_comes_into_the_way_of_one_bone_is_no_matter_to_others_and_goes_again(live_file):
    rig = moving_rig()
    lower = rig.pose.bones["Lower"]
    curves_of(lower)["location", 1].modifiers.new("ENVELOPE")
    bpy.context.view_layer.update()
    assert "Lower" in problem_of(lower)
    assert not any(map(is_term, (item for curve in curves_of(lower).values() for item in curve.modifiers)))
    assert_posed(rig, BETWEEN, ["Body", "Upper"])
    modifiers = curves_of(lower)["location", 1].modifiers
    modifiers.remove(modifiers[0])
    bpy.context.view_layer.update()
    assert problem_of(lower) == ""
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()
