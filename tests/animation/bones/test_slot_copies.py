"""What Blender makes of slots and Actions in one go has the modes it was made from, and nothing stale."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, refresh, set_mode
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import FRAMES, PLAYED, key_all, moving_rig, new_rig, own_constraints
from tests.animation.bones.test_rigs_in_edit_mode import HANDS
from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object


def mode_of(carrier: bpy.types.Object | bpy.types.PoseBone) -> str:
    (mode,) = modes_of(carrier, np.array(FRAMES[:1]))
    return mode


def with_duplicate(obj: bpy.types.Object, original: bpy.types.Object) -> bpy.types.Object:
    """Have an object use a duplicate of the slot that another uses."""
    data = original.animation_data
    duplicate = data.action_slot.duplicate()
    obj.animation_data_create().action = data.action
    obj.animation_data.action_slot = duplicate
    bpy.context.view_layer.update()
    return obj


@pytest.fixture
def moved(live_file) -> bpy.types.Object:
    obj = key(new_object())
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    return obj


def test_a_duplicate_of_a_slot_goes_its_own_way(moved):
    other = with_duplicate(new_object("Other"), moved)
    set_mode(moved, "pga_lerp")
    curves_of(other)["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert (mode_of(moved), mode_of(other)) == ("pga_lerp", "dq_sclerp")
    set_mode(other, "BLENDER")
    bpy.context.view_layer.update()
    assert (mode_of(moved), mode_of(other)) == ("pga_lerp", "BLENDER")
    assert_shown([moved, other], PLAYED)


@pytest.mark.parametrize("user", ["itself", "another"])
def test_a_rig_that_gets_a_duplicate_of_a_slot_gets_the_modes_of_all_bones(live_file, user):
    rig = moving_rig("dq_sclerp")
    set_mode(rig.pose.bones["Hand"], "BLENDER")
    set_mode(rig.pose.bones["Lower"], "pga_lerp", FRAMES[1:2])
    bpy.context.view_layer.update()
    other = with_duplicate(rig if user == "itself" else new_rig("Other"), rig)
    modes = {bone.name: modes_of(bone, np.array(FRAMES[:2])) for bone in other.pose.bones}
    assert modes == {
        "Body": ["dq_sclerp", "dq_sclerp"],
        "Upper": ["dq_sclerp", "dq_sclerp"],
        "Lower": ["dq_sclerp", "pga_lerp"],
        "Hand": ["BLENDER", "BLENDER"],
    }
    assert {name: len(held) for name, held in own_constraints(other).items()} == {
        "Body": 1,
        "Upper": 1,
        "Lower": 1,
        "Hand": 0,
    }
    assert_posed(rig, PLAYED)
    assert_posed(other, PLAYED)
    assert refresh() == 0


@pytest.mark.parametrize("modes", [("dq_sclerp", "BLENDER"), ("BLENDER", "dq_sclerp"), ("dq_sclerp", "pga_lerp")])
def test_an_action_that_is_flipped_leaves_each_bone_its_mode_and_nothing_of_the_other(live_file, modes):
    rig = key_all(new_rig("Rig", HANDS))
    hands = [rig.pose.bones[name] for name in ("Hand.L", "Hand.R")]
    for hand, mode in zip(hands, modes, strict=True):
        set_mode(hand, mode)
    bpy.context.view_layer.update()
    rig.animation_data.action.flip_with_pose(rig)
    bpy.context.view_layer.update()
    assert [mode_of(hand) for hand in hands] == list(modes)
    assert [len(own_constraints(rig)[hand.name]) for hand in hands] == [int(mode != "BLENDER") for mode in modes]
    assert_posed(rig, PLAYED)
    assert refresh() == 0
