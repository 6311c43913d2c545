"""Slots that are moved between Actions, duplicated and chosen: what a rig moves by keeps its keys and its modes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, refresh, set_enabled, set_mode
from tests.animation.bones.poses import Poses, assert_posed, assert_same_poses, shown_poses
from tests.animation.bones.rigs import BETWEEN, FRAMES, PLAYED, key_all, moving_rig, new_rig, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.keyed import Carrier, curves_of, snapshot
from tests.animation.oracle import assert_shown
from tests.animation.scenes import editor, key, new_object


def merge_into(first: bpy.types.Object, *others: bpy.types.Object) -> None:
    """Move the slots of others into the Action of the first."""
    select_only(first, *others)
    bpy.ops.anim.merge_animation()
    bpy.context.view_layer.update()


def separate_slots_of(obj: bpy.types.Object) -> None:
    """Put each slot of an object's Action into one of its own."""
    select_only(obj)
    with editor("DOPESHEET_EDITOR", "ACTION"):
        bpy.ops.anim.separate_slots()
    bpy.context.view_layer.update()


def modes(carrier: Carrier, keys: int = 1) -> list[str]:
    """Those of the first segments."""
    return modes_of(carrier, np.array(FRAMES[:keys]))


@pytest.fixture
def rig(live_file) -> bpy.types.Object:
    """The arm in one mode, but for one segment of its hand, and without a mode of its body."""
    rig = moving_rig("dq_sclerp")
    set_mode(rig.pose.bones["Hand"], "pga_lerp", [FRAMES[1]])
    set_mode(rig.pose.bones["Body"], "BLENDER")
    return rig


def assert_moves_as_before(rig: bpy.types.Object, keys: dict, before: Poses) -> None:
    assert snapshot(rig) == keys
    assert [*modes(rig.pose.bones["Hand"], 3), *modes(rig.pose.bones["Body"])] == [
        *("dq_sclerp", "pga_lerp", "dq_sclerp", "BLENDER")
    ]
    assert_same_poses(rig, BETWEEN, shown_poses([rig], BETWEEN)[0], before)
    assert_posed(rig, BETWEEN)


@pytest.mark.parametrize("live", [True, False], ids=["live", "live update off"])
def test_slots_that_are_merged_and_separated_keep_their_keys_and_modes(rig, live):
    tool, twin = key(new_object("Tool")), moving_rig("pga_lerp", name="Twin", seed=5)
    set_mode(tool, "pga_slerp")
    # Slots may be called as one likes, also after another rig.
    for obj, name in ((rig, "Spare"), (twin, "Rig"), (rig, "Twin")):
        obj.animation_data.action_slot.name_display = name
    bpy.context.view_layer.update()
    keys, (before,), of_twin = snapshot(rig), shown_poses([rig], BETWEEN), snapshot(twin)
    set_enabled(live)
    try:
        merge_into(tool, rig, twin)
        assert rig.animation_data.action == twin.animation_data.action == tool.animation_data.action
        assert_moves_as_before(rig, keys, before)
        separate_slots_of(rig)
    finally:
        set_enabled(True)
    assert [len(obj.animation_data.action.slots) for obj in (rig, twin, tool)] == [1, 1, 1]
    assert_moves_as_before(rig, keys, before)
    assert snapshot(twin) == of_twin
    assert modes(tool) == ["pga_slerp"]
    assert_posed(twin, BETWEEN)
    assert_shown([tool], PLAYED)
    assert_nothing_stale()
    curves_of(rig.pose.bones["Upper"])["location", 0].keyframe_points[1].co_ui.y += 0.3
    bpy.context.view_layer.update()
    assert_posed(rig, BETWEEN)


@pytest.mark.parametrize("user", ["itself", "another"])
def test_a_duplicate_of_a_slot_moves_alike_and_goes_its_own_way(rig, user):
    keys, (before,) = snapshot(rig), shown_poses([rig], BETWEEN)
    data = rig.animation_data
    first, duplicate = data.action_slot, data.action_slot.duplicate()
    other = rig if user == "itself" else new_rig("Other")
    other.animation_data_create().action = data.action
    other.animation_data.action_slot = duplicate
    bpy.context.view_layer.update()
    assert_moves_as_before(other, keys, before)
    set_mode(other.pose.bones["Hand"], "BLENDER")
    curves_of(other.pose.bones["Lower"])["location", 0].keyframe_points[1].co_ui.y += 0.3
    bpy.context.view_layer.update()
    assert modes(other.pose.bones["Hand"], 3) == ["BLENDER"] * 3
    assert_posed(other, BETWEEN)
    data.action_slot = first
    bpy.context.view_layer.update()
    assert_moves_as_before(rig, keys, before)
    assert_nothing_stale()


def test_an_action_without_modes_takes_none_from_the_strips_beside_it(rig):
    data = rig.animation_data
    data.nla_tracks.new().strips.new("Strip", 1, data.action)
    data.action = None
    key_all(rig, seed=3)
    plain = data.action
    for action in (None, plain):
        data.action = action
        bpy.context.view_layer.update()
    refresh()
    assert modes(rig.pose.bones["Hand"]) == ["BLENDER"]


def test_a_rig_whose_slot_was_removed_keeps_nobody_from_following_edits(rig):
    tool = key(new_object("Tool"))
    set_mode(tool, "dq_sclerp")
    rig.animation_data.action.slots.remove(rig.animation_data.action_slot)
    curves_of(tool)["location", 0].keyframe_points[1].co_ui.y += 0.5
    rig.update_tag()
    bpy.context.view_layer.update()
    assert refresh() == 0
    assert_shown([tool], PLAYED)
