"""Slots that are moved between Actions, duplicated and chosen: what a rig moves by keeps its keys and its modes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, set_enabled, set_mode
from tests.animation.bones.poses import Poses, assert_posed, assert_same_poses, shown_poses
from tests.animation.bones.rigs import BETWEEN, PLAYED, moving_rig, new_rig, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.keyed import Carrier, curves_of, snapshot
from tests.animation.oracle import assert_shown
from tests.animation.scenes import FRAMES, editor, key, new_object


def modes(carrier: Carrier, keys: int = 1) -> list[str]:
    """Those of the first segments."""
    return modes_of(carrier, np.array(FRAMES[:keys]))


def move_a_key(carrier: Carrier) -> None:
    curves_of(carrier)["location", 0].keyframe_points[1].co_ui.y += 0.3
    bpy.context.view_layer.update()


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
    select_only(tool, rig, twin)
    bpy.ops.anim.merge_animation()
    bpy.context.view_layer.update()
    assert rig.animation_data.action == twin.animation_data.action == tool.animation_data.action
    assert_moves_as_before(rig, keys, before)
    select_only(rig)
    with editor("DOPESHEET_EDITOR", "ACTION"):
        bpy.ops.anim.separate_slots()
    bpy.context.view_layer.update()
    set_enabled(True)
    assert [len(obj.animation_data.action.slots) for obj in (rig, twin, tool)] == [1, 1, 1]
    assert_moves_as_before(rig, keys, before)
    assert snapshot(twin) == of_twin
    assert modes(tool) == ["pga_slerp"]
    assert_posed(twin, BETWEEN)
    assert_shown([tool], PLAYED)
    move_a_key(rig.pose.bones["Upper"])
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()


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
    move_a_key(other.pose.bones["Lower"])
    assert modes(other.pose.bones["Hand"], 3) == ["BLENDER"] * 3
    assert_posed(other, BETWEEN)
    data.action_slot = first
    bpy.context.view_layer.update()
    assert_moves_as_before(rig, keys, before)
    assert_nothing_stale()
