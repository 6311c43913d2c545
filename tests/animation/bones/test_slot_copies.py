"""What Blender makes of slots and Actions in one go has the modes it was made from, and nothing stale."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, refresh, set_mode
from rigid_motion.animation.actions.records import recorded_mode
from rigid_motion.animation.actions.slots import bindings_for
from rigid_motion.animation.compute.components import MODE_NAMES
from rigid_motion.animation.transforms import transform_of
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import ARM, FRAMES, PLAYED, Rest, key_all, moving_rig, new_rig, own_constraints
from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object

SIDES = (
    Rest("Body", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    Rest("Hand.L", (0.5, 0.0, 1.0), (1.0, 0.0, 1.0), "Body"),
    Rest("Hand.R", (-0.5, 0.0, 1.0), (-1.0, 0.0, 1.0), "Body"),
)


def mode_of(carrier: bpy.types.Object | bpy.types.PoseBone) -> str:
    (mode,) = modes_of(carrier, np.array(FRAMES[:1]))
    return mode


def modes_in(rig: bpy.types.Object, slot: bpy.types.ActionSlot) -> list[str]:
    """The modes that bones have throughout in one of the slots that move them."""
    places = (place for bone in rig.pose.bones for place in bindings_for(transform_of(bone)))
    return [MODE_NAMES[recorded_mode(place)] for place in places if place.slot.handle == slot.handle]


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


def test_an_object_that_gets_a_duplicate_of_a_slot_gets_its_mode(moved):
    other = with_duplicate(new_object("Other"), moved)
    assert mode_of(other) == other.rigid_motion.mode == "dq_sclerp"
    assert_shown([moved, other], PLAYED)
    assert refresh() == 0


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


def test_a_duplicate_of_a_slot_has_the_mode_that_was_duplicated_and_not_that_of_its_new_user(moved):
    other = key(new_object("Other"))
    set_mode(other, "pga_lerp")
    bpy.context.view_layer.update()
    assert mode_of(with_duplicate(other, moved)) == "dq_sclerp"
    assert_shown([moved, other], PLAYED)


def test_a_slot_with_the_same_keys_that_is_no_duplicate_has_no_mode(moved):
    other = new_object("Other")
    action = moved.animation_data.action
    other.animation_data_create().action = action
    other.animation_data.action_slot = action.slots.new("OBJECT", "Other")
    key(other)
    bpy.context.view_layer.update()
    assert mode_of(other) == "BLENDER"
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


@pytest.mark.parametrize("mode", ["dq_sclerp", "BLENDER"])
def test_a_duplicate_beside_its_original_in_strips_has_the_mode_that_it_had(live_file, mode):
    rig = moving_rig("dq_sclerp")
    bpy.context.view_layer.update()
    data = rig.animation_data
    action, original = data.action, data.action_slot
    duplicate = with_duplicate(rig, rig).animation_data.action_slot
    set_mode(list(rig.pose.bones), mode)
    data.action = None
    for start, slot in ((1, original), (101, duplicate)):
        data.nla_tracks.new().strips.new("Strip", start, action).action_slot = slot
    bpy.context.view_layer.update()
    refresh()
    assert modes_in(rig, original) == ["dq_sclerp"] * len(ARM)
    assert modes_in(rig, duplicate) == [mode] * len(ARM)
    assert refresh() == 0


@pytest.mark.parametrize("modes", [("dq_sclerp", "BLENDER"), ("BLENDER", "dq_sclerp"), ("dq_sclerp", "pga_lerp")])
def test_an_action_that_is_flipped_leaves_each_bone_its_mode_and_nothing_of_the_other(live_file, modes):
    rig = key_all(new_rig("Rig", SIDES))
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
