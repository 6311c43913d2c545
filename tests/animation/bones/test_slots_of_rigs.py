"""Blender's operators move slots between Actions, and choose them: rigs keep their keys and their modes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, refresh, set_enabled, set_mode
from tests.animation.bones.poses import assert_posed, assert_same_poses, shown_poses
from tests.animation.bones.rigs import FRAMES, PLAYED, key_all, moving_rig, new_rig, own_constraints, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.oracle import assert_shown, snapshot
from tests.animation.scenes import key, new_object


@contextmanager
def action_editor() -> Iterator[None]:
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    before, area.type = area.type, "DOPESHEET_EDITOR"
    area.spaces.active.mode = "ACTION"
    try:
        with bpy.context.temp_override(window=window, area=area):
            yield
    finally:
        area.type = before


def merge_into(first: bpy.types.Object, *others: bpy.types.Object) -> None:
    """Move the slots of others into the Action of the first."""
    select_only(first, *others)
    bpy.ops.anim.merge_animation()
    bpy.context.view_layer.update()


def separate_slots_of(obj: bpy.types.Object) -> None:
    """Put each slot of an object's Action into one of its own."""
    select_only(obj)
    with action_editor():
        bpy.ops.anim.separate_slots()
    bpy.context.view_layer.update()


def slots_of_rig(rig: bpy.types.Object) -> list[str]:
    return [slot.name_display for slot in rig.animation_data.action.slots]


def assert_only_its_own(rig: bpy.types.Object) -> None:
    """Its Action has its keys and its differences, and its constraints show these."""
    action = rig.animation_data.action
    assert slots_of_rig(rig) == [rig.animation_data.action_slot.name_display, "Rigid Motion"]
    assert {constraint.action for held in own_constraints(rig).values() for constraint in held} == {action}
    assert not [one.name for one in bpy.data.actions if one.name.startswith("Rigid Motion")]
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


def test_rigs_that_share_a_slot_share_it_when_it_is_separated(live_file):
    rig, other = moving_rig(), new_rig("Other")
    tool = key(new_object("Tool"))
    other.animation_data_create().action = rig.animation_data.action
    other.animation_data.action_slot = rig.animation_data.action_slot
    bpy.context.view_layer.update()
    merge_into(rig, tool)
    separate_slots_of(rig)
    assert other.animation_data.action == rig.animation_data.action
    assert_only_its_own(rig)
    assert_posed(rig, PLAYED)
    assert_posed(other, PLAYED)


def test_separated_slots_are_undone_and_redone(live_file):
    rig = moving_rig()
    merge_into(rig, key(new_object("Tool")))
    keys = snapshot(rig)
    bpy.ops.ed.undo_push(message="merged")
    separate_slots_of(rig)
    bpy.ops.ed.undo_push(message="separated")
    for step, slots in ((bpy.ops.ed.undo, 3), (bpy.ops.ed.redo, 2)):
        step()
        rig = bpy.data.objects["Rig"]
        bpy.context.view_layer.update()
        assert len(rig.animation_data.action.slots) == slots
        assert snapshot(rig) == keys
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
