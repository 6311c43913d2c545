"""Blender's operators move slots between Actions, and choose them: rigs keep their keys and their modes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, refresh, set_enabled, set_mode
from tests.animation.bones.poses import assert_posed, assert_same_poses, shown_poses
from tests.animation.bones.rigs import FRAMES, PLAYED, key_all, moving_rig, new_rig, own_constraints, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import assert_shown
from tests.animation.scenes import editor, key, new_object, new_strip


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


def slots_of_rig(rig: bpy.types.Object) -> list[str]:
    return [slot.name_display for slot in rig.animation_data.action.slots]


def assert_only_its_own(rig: bpy.types.Object) -> None:
    """Its Action has its keys and its differences, and its constraints show these."""
    action = rig.animation_data.action
    assert slots_of_rig(rig) == [rig.animation_data.action_slot.name_display, "Rigid Motion"]
    assert {constraint.action for held in own_constraints(rig).values() for constraint in held} == {action}
    assert not [item.name for item in bpy.data.actions if item.name.startswith("Rigid Motion")]
    assert_nothing_stale(action)


@pytest.mark.parametrize("live", [True, False], ids=["live", "refreshed later"])
def test_a_rig_whose_slots_are_separated_keeps_its_keys_and_its_modes(live_file, live):
    rig, tool = moving_rig(), key(new_object("Tool"))
    set_mode(rig.pose.bones["Hand"], "pga_lerp", [FRAMES[1]])
    set_mode(tool, "pga_slerp")
    merge_into(rig, tool)
    keys, before = snapshot(rig), shown_poses([rig], PLAYED)[0]
    set_enabled(live)
    try:
        separate_slots_of(rig)
    finally:
        set_enabled(True)
    if not live:
        refresh()
    assert_only_its_own(rig)
    assert snapshot(rig) == keys
    assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:3])) == ["dq_sclerp", "pga_lerp", "dq_sclerp"]
    assert modes_of(rig.pose.bones["Body"], np.array(FRAMES[:1])) == ["dq_sclerp"]
    assert modes_of(tool, np.array(FRAMES[:1])) == ["pga_slerp"]
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], before)
    assert_posed(rig, PLAYED)
    assert_shown([tool], PLAYED)
    assert refresh() == 0


def test_rigs_with_the_same_bones_whose_slots_are_separated_get_each_its_own_keys(live_file):
    first, second = moving_rig(name="First"), moving_rig("pga_lerp", name="Second", seed=5)
    # Slots may be called as one likes, also after the other rig.
    for rig, name in ((first, "Spare"), (second, "First"), (first, "Second")):
        rig.animation_data.action_slot.name_display = name
        bpy.context.view_layer.update()
    merge_into(first, second)
    keys = [snapshot(rig) for rig in (first, second)]
    separate_slots_of(first)
    for rig, own, mode in zip((first, second), keys, ("dq_sclerp", "pga_lerp"), strict=True):
        assert snapshot(rig) == own
        assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:1])) == [mode]
        assert_only_its_own(rig)
        assert_posed(rig, PLAYED)


def test_a_rig_whose_slot_moves_to_another_action_takes_its_modes_along(live_file):
    rig, tool = moving_rig(), key(new_object("Tool"))
    set_mode(rig.pose.bones["Hand"], "pga_lerp", [FRAMES[1]])
    merge_into(tool, rig)
    assert rig.animation_data.action == tool.animation_data.action
    assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:3])) == ["dq_sclerp", "pga_lerp", "dq_sclerp"]
    assert modes_of(rig.pose.bones["Body"], np.array(FRAMES[:1])) == ["dq_sclerp"]
    assert tool.rigid_motion.mode == "BLENDER"
    assert_posed(rig, PLAYED)
    assert_shown([tool], PLAYED)


def test_an_action_without_modes_takes_none_from_the_strips_beside_it(live_file):
    rig = moving_rig()
    data = rig.animation_data
    data.nla_tracks.new().strips.new("Strip", 1, data.action)
    data.action = None
    key_all(rig, seed=3)
    plain = data.action
    bpy.context.view_layer.update()
    for action in (None, plain):
        data.action = action
        bpy.context.view_layer.update()
        refresh()
    assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:1])) == ["BLENDER"]


def strip_of(rig: bpy.types.Object, action: bpy.types.Action, start: int = 1) -> bpy.types.NlaStrip:
    tracks = rig.animation_data_create().nla_tracks
    track = tracks[0] if len(tracks) else tracks.new()
    strip = track.strips.new("Strip", start, action)
    bpy.context.view_layer.update()
    return strip


def frames_of(strip: bpy.types.NlaStrip) -> tuple[float, ...]:
    """Of the scene, and of the Action."""
    return (strip.frame_start, strip.frame_end, strip.action_frame_start, strip.action_frame_end)


def test_a_strip_with_the_action_of_another_rig_shows_its_keys_and_modes(live_file):
    hero, villain = moving_rig(name="Hero"), new_rig("Villain")
    strip = strip_of(villain, hero.animation_data.action)
    assert strip.action_slot == hero.animation_data.action_slot
    assert frames_of(strip) == (1.0, 40.0, 1.0, 40.0)
    assert_same_poses(villain, PLAYED, *(shown_poses([rig], PLAYED)[0] for rig in (villain, hero)))
    assert_posed(hero, PLAYED)


@pytest.mark.parametrize("modes", [True, False], ids=["with modes", "without"])
def test_strips_with_the_action_of_another_rig_are_as_long_as_without_modes(live_file, modes):
    hero, villain = key_all(new_rig("Hero"), (-7.0, 5.0, 30.0)), new_rig("Villain")
    if modes:
        set_mode(list(hero.pose.bones), "dq_sclerp")
    action = hero.animation_data.action
    strips = [strip_of(villain, action, start) for start in (5, 80)]
    assert [frames_of(strip) for strip in strips] == [(5.0, 42.0, -7.0, 30.0), (80.0, 117.0, -7.0, 30.0)]


def test_a_strip_with_the_action_of_another_rig_does_not_reach_into_the_next(live_file):
    hero, villain = moving_rig(name="Hero"), new_rig("Villain")
    strip_of(villain, hero.animation_data.action, 21)
    # Without a range of its own, Blender makes a strip without a slot one frame long.
    hero.animation_data.action.use_frame_range = False
    before = strip_of(villain, hero.animation_data.action, 11)
    assert frames_of(before) == (11.0, 21.0, 1.0, 11.0)


def test_a_strip_that_is_to_show_no_slot_shows_none(live_file):
    hero, villain = moving_rig(name="Hero"), new_rig("Villain")
    strip = strip_of(villain, hero.animation_data.action)
    strip.action_slot = None
    bpy.context.view_layer.update()
    villain.location.x = 1.0
    bpy.context.view_layer.update()
    refresh()
    assert strip.action_slot is None
    assert not any(own_constraints(villain).values())


def test_a_strip_is_given_no_slot_where_there_are_two_with_keys(live_file):
    hero, tool, villain = moving_rig(name="Hero"), key(new_object("Tool")), new_rig("Villain")
    merge_into(hero, tool)
    assert strip_of(villain, hero.animation_data.action).action_slot is None


def test_a_rig_whose_slot_was_removed_keeps_nobody_from_following_edits(live_file, caplog):
    rig, tool = moving_rig(), key(new_object("Tool"))
    set_mode(tool, "dq_sclerp")
    action = rig.animation_data.action
    action.slots.remove(rig.animation_data.action_slot)
    assert rig.animation_data.action_slot is None
    curves_of(tool)["location", 0].keyframe_points[1].co_ui.y += 0.5
    rig.update_tag()
    bpy.context.view_layer.update()
    assert refresh() == 0
    assert_shown([tool], PLAYED)
    assert not any(own_constraints(rig).values())
    assert not caplog.records


def unlink(rig: bpy.types.Object) -> None:
    rig.animation_data.action = None


def go_to_another_slot(rig: bpy.types.Object) -> None:
    rig.animation_data.action_slot = rig.animation_data.action.slots.new("OBJECT", "Other")


@pytest.mark.parametrize("leave", [unlink, go_to_another_slot])
def test_a_rig_that_turns_otherwise_gets_in_betweens_of_its_own_when_the_other_leaves(live_file, leave):
    rig = key_all(new_rig("A"))
    other = rig.copy()
    other.name = "B"
    bpy.context.scene.collection.objects.link(other)
    for bone in other.pose.bones:
        bone.rotation_mode = "XYZ"
    key_all(other, seed=4)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    for _ in range(2):
        other.update_tag()
        bpy.context.view_layer.update()
    with pytest.raises(AssertionError, match="B, Body"):
        assert_posed(other, PLAYED)
    leave(rig)
    bpy.context.view_layer.update()
    assert_posed(other, PLAYED)
    assert refresh() == 0


@pytest.mark.parametrize("alone", [False, True], ids=["by itself and in a strip", "in a strip alone"])
def test_a_strip_of_a_slot_that_is_separated_keeps_its_keys(live_file, alone):
    rig, other = moving_rig(), moving_rig("pga_lerp", name="Other", seed=5)
    merge_into(rig, other)
    (before,) = shown_poses([rig], PLAYED)
    data = rig.animation_data
    strip = new_strip(rig, 1, data.action, data.action_slot)
    if alone:
        data.action = None
    bpy.context.view_layer.update()
    separate_slots_of(other if alone else rig)
    assert [slot.name_display for slot in strip.action.slots] == ["Rig", "Rigid Motion"]
    data.action = None
    bpy.context.view_layer.update()
    assert_same_poses(rig, PLAYED, shown_poses([rig], PLAYED)[0], before)
