"""Rigs in Edit Mode: what Blender does to bones there finds no F-curves that it cannot handle, and nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import pytest

from rigid_motion import animation
from rigid_motion.animation import constraint_trouble, refresh, set_enabled, set_mode
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses
from tests.animation.bones.rigs import PLAYED, Rest, key_all, moving_rig, new_rig, own_constraints, select_only
from tests.animation.bones.test_bone_files import posed_on_a_farm, save
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.farm import SAVE, on_a_farm

HANDS = (
    Rest("Body", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    Rest("Hand.L", (0.5, 0.0, 1.0), (1.0, 0.1, 1.0), "Body", roll=0.3),
    Rest("Hand.R", (-0.5, 0.0, 1.0), (-1.0, 0.1, 1.0), "Body", roll=-0.3),
)


def rig_with_hands(*bones: Rest, mode: str = "dq_sclerp") -> bpy.types.Object:
    rig = key_all(new_rig("Rig", bones or HANDS))
    set_mode(list(rig.pose.bones), mode)
    return rig


@contextmanager
def edit_mode(rig: bpy.types.Object) -> Iterator[bpy.types.ArmatureEditBones]:
    select_only(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    yield rig.data.edit_bones
    bpy.ops.object.mode_set(mode="OBJECT")


def symmetrize(edit_bones: bpy.types.ArmatureEditBones, name: str = "Hand.L") -> None:
    for bone in edit_bones:
        bone.select = bone.select_head = bone.select_tail = bone.name == name
    bpy.ops.armature.symmetrize()


def shown_slots(rig: bpy.types.Object) -> dict[str, tuple[str, ...]]:
    return {
        name: tuple(slot.name_display for held in constraints if (slot := held.action_slot) is not None)
        for name, constraints in own_constraints(rig).items()
    }


ALL_SHOWN = dict.fromkeys(("Body", "Hand.L", "Hand.R"), ("Rigid Motion",))
NONE_SHOWN = dict.fromkeys(ALL_SHOWN, ())


@pytest.mark.parametrize("live", [True, False], ids=["live", "live update off"])
def test_bones_with_modes_can_be_symmetrized(live_file, live):
    rig = rig_with_hands()
    set_enabled(live)
    try:
        with edit_mode(rig) as edit_bones:
            symmetrize(edit_bones)
    finally:
        set_enabled(True)
    assert shown_slots(rig) == ALL_SHOWN
    assert refresh() == 0
    assert_posed(rig, PLAYED)
    assert_nothing_stale()


def test_a_bone_that_symmetrize_makes_rests_and_has_no_constraint_of_the_first(live_file):
    rig = rig_with_hands(*HANDS[:2])
    with edit_mode(rig) as edit_bones:
        symmetrize(edit_bones)
    assert shown_slots(rig) == ALL_SHOWN | {"Hand.R": ()}
    assert own_constraints(rig)["Hand.R"] == []
    assert rig.pose.bones["Hand.R"].rigid_motion.mode == "BLENDER"
    assert_posed(rig, PLAYED)
    key_all(rig)
    set_mode(rig.pose.bones["Hand.R"], "pga_lerp")
    assert_posed(rig, PLAYED)


def test_in_edit_mode_constraints_show_nothing_and_nobody_takes_them_for_removed(live_file):
    rig = rig_with_hands()
    with edit_mode(rig):
        assert shown_slots(rig) == NONE_SHOWN
        assert refresh() == 0
        assert {constraint_trouble(bone) for bone in rig.pose.bones} == {""}
        assert {animation.problem_of(bone) for bone in rig.pose.bones} == {""}
        bpy.context.view_layer.update()
        assert shown_slots(rig) == NONE_SHOWN
    assert shown_slots(rig) == ALL_SHOWN
    assert refresh() == 0
    assert_posed(rig, PLAYED)


def test_a_constraint_that_was_deleted_is_not_brought_back_by_edit_mode(live_file):
    rig = rig_with_hands()
    hand = rig.pose.bones["Hand.L"]
    hand.constraints.remove(hand.constraints["Rigid Motion"])
    with edit_mode(rig):
        pass
    assert own_constraints(rig)["Hand.L"] == []
    assert constraint_trouble(rig.pose.bones["Hand.L"]) == "REMOVED"


def test_a_file_that_is_saved_in_edit_mode_plays_in_a_blender_without_the_extension(live_file, tmp_path):
    rig = rig_with_hands()
    expected = expected_poses(rig, PLAYED)
    with edit_mode(rig):
        path = save(tmp_path / "shot.blend")
        assert shown_slots(rig) == NONE_SHOWN
    on_a_farm("bpy.ops.object.mode_set(mode='OBJECT')\n" + SAVE, path, path)
    played = posed_on_a_farm(path, rig)
    assert_same_poses(rig, PLAYED, played, expected)


def test_a_rig_in_edit_mode_gets_its_slots_back_when_the_extension_is_switched_off(live_file):
    rig = moving_rig()
    with edit_mode(rig):
        animation.unregister()
        shown = shown_slots(rig)
        animation.register()
    assert shown == dict.fromkeys(shown, ("Rigid Motion",))
