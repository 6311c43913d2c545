"""The way back from baked and reduced keys, whatever has become of bones and their names meanwhile."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    Refused,
    bake,
    channelbag_of,
    is_baked,
    reduce_keys_of,
    refresh,
    set_mode,
    unbake,
)
from tests.animation.bones.poses import assert_posed, assert_same_poses, shown_poses
from tests.animation.bones.rigs import PLAYED, key_all, moving_rig, new_rig, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale, make_lower_fore, swap_two
from tests.animation.bones.test_slots_of_rigs import separate_slots_of
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import editor, key, new_object, new_strip, push_down

OF_BOTH = pytest.mark.parametrize("of_bones", [False, True], ids=["object", "bones"])


def moving(of_bones: bool, mode: str = "dq_sclerp", name: str = "Mover") -> tuple[bpy.types.Object, list]:
    """A rig or an object that has a mode, and what has it."""
    obj = moving_rig(mode, name=name) if of_bones else key(new_object(name), seed=len(mode))
    set_mode(targets := list(obj.pose.bones) if of_bones else [obj], mode)
    return obj, targets


@pytest.mark.parametrize("rename", [make_lower_fore, swap_two], ids=lambda rename: rename.__name__)
@pytest.mark.parametrize("count", [2, 4], ids=["some bones baked", "all bones baked"])
def test_bones_that_were_renamed_get_their_own_keys_back(live_file, count, rename):
    rig = moving_rig()
    own, before = rig.animation_data.action, [snapshot(bone) for bone in rig.pose.bones]
    bake(list(rig.pose.bones)[:count])
    rename(rig)
    bpy.context.view_layer.update()
    unbake(list(rig.pose.bones)[:count])
    bpy.context.view_layer.update()
    assert rig.animation_data.action == own
    assert [snapshot(bone) for bone in rig.pose.bones] == before
    assert_posed(rig, PLAYED)
    assert_nothing_stale()


@pytest.mark.parametrize("count", [2, 4], ids=["some bones baked", "all bones baked"])
def test_another_rig_that_plays_baked_keys_keeps_them(live_file, count):
    rig = moving_rig()
    own, before = rig.animation_data.action, [snapshot(bone) for bone in rig.pose.bones]
    bake(list(rig.pose.bones)[:count])
    shared = rig.animation_data.action
    other = new_rig("Other")
    other.animation_data_create().action = shared
    other.animation_data.action_slot = shared.slots[0]
    refresh()
    keys, expected = [snapshot(bone) for bone in other.pose.bones], shown_poses([other], PLAYED)[0]
    unbake(list(rig.pose.bones)[:count])
    refresh()
    assert (rig.animation_data.action, other.animation_data.action) == (own, shared)
    assert [snapshot(bone) for bone in rig.pose.bones] == before
    assert [snapshot(bone) for bone in other.pose.bones] == keys
    assert_same_poses(other, PLAYED, shown_poses([other], PLAYED)[0], expected)
    assert not [action for action in bpy.data.actions if not action.users]
    assert_nothing_stale()


@pytest.mark.parametrize("muted", [False, True], ids=["without keys", "muted"])
@OF_BOTH
def test_what_has_no_keys_gets_its_value_back(live_file, of_bones, muted):
    obj = key_all(new_rig()) if of_bones else key(new_object())
    carrier, targets = (obj.pose.bones["Upper"], list(obj.pose.bones)) if of_bones else (obj, obj)
    for index in (1, 2):
        fcurve = curves_of(carrier)["location", index]
        if muted:
            fcurve.mute = True
        else:
            channelbag_of(obj).fcurves.remove(fcurve)
    carrier.location.yz = rest = (0.75, 0.25)
    set_mode(targets, "dq_sclerp")
    expected = shown_poses([obj], PLAYED)[0] if of_bones else shown_worlds([obj], PLAYED)[0]
    bpy.context.scene.frame_set(20)
    bake(targets)
    bpy.context.view_layer.update()
    assert tuple(carrier.location.yz) != rest
    unbake(targets)
    assert tuple(carrier.location.yz) == rest
    if of_bones:
        assert_same_poses(obj, PLAYED, shown_poses([obj], PLAYED)[0], expected)
        assert_posed(obj, PLAYED)
    else:
        assert np.abs(shown_worlds([obj], PLAYED)[0] - expected).max() < 1e-5


def sharing(of_bones: bool) -> tuple[bpy.types.Object, list, bpy.types.Object]:
    """Something baked, its targets, and what still moves by its original."""
    obj, targets = moving(of_bones)
    targets = targets[:2]
    other = obj.copy()
    bpy.context.scene.collection.objects.link(other)
    bake(targets)
    bpy.context.view_layer.update()
    return obj, targets, other


@OF_BOTH
def test_a_slot_that_was_renamed_in_the_original_is_found(live_file, of_bones):
    obj, targets, other = sharing(of_bones)
    other.animation_data.action_slot.name_display = "Hero"
    unbake(targets)
    assert (obj.animation_data.action, obj.animation_data.action_slot) == (
        other.animation_data.action,
        other.animation_data.action_slot,
    )


@OF_BOTH
def test_a_slot_that_was_taken_out_of_the_original_refuses_the_way_back_with_a_way_out(live_file, of_bones):
    obj, targets, other = sharing(of_bones)
    baked, original = obj.animation_data.action, other.animation_data.action
    separate_slots_of(other)
    assert other.animation_data.action != original
    with pytest.raises(Refused, match=f"their slot was taken out of the Action {original.name}. Choose by hand"):
        unbake(targets)
    assert obj.animation_data.action == baked
    assert is_baked(targets[0])
    refused = []
    bake(list(other.pose.bones) if of_bones else other, refused=refused)
    assert refused == []


def put_into_a_meta_strip(obj: bpy.types.Object) -> None:
    for strip in obj.animation_data.nla_tracks[0].strips:
        strip.select = True
    obj.animation_data.nla_tracks[0].select = True
    with editor("NLA_EDITOR"):
        bpy.ops.nla.meta_add()


def shown(obj: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    if obj.pose is None:
        return shown_worlds([obj], frames)[0]
    return np.stack([*shown_poses([obj], frames)[0].values()])


@OF_BOTH
def test_what_plays_in_a_strip_of_strips_is_baked_there(live_file, of_bones):
    obj, targets = moving(of_bones)
    own = push_down(obj).action
    select_only(obj)
    put_into_a_meta_strip(obj)
    bpy.context.view_layer.update()
    before = shown(obj, PLAYED)
    (strip,) = obj.animation_data.nla_tracks[0].strips[0].strips
    for act, action in ((bake, f"{own.name} Baked"), (unbake, own.name)):
        act(targets)
        bpy.context.view_layer.update()
        assert strip.action.name == action
        assert np.abs(shown(obj, PLAYED) - before).max() < 2e-5


@pytest.mark.parametrize("in_strips", [False, True], ids=["Action and strip", "two strips"])
@OF_BOTH
def test_two_slots_of_one_action_that_move_the_same_are_baked_each_for_itself(live_file, of_bones, in_strips):
    (obj, targets), (other, _) = moving(of_bones, name="A"), moving(of_bones, "pga_lerp", "B")
    select_only(obj, other)
    bpy.ops.anim.merge_animation()
    data = obj.animation_data
    action, own = data.action, data.action_slot
    starts = [(1, own)] if in_strips else []
    if in_strips:
        data.action = None
    for start, slot in (*starts, (50, other.animation_data.action_slot)):
        strip = new_strip(obj, start, action, slot)
    bpy.context.view_layer.update()
    frames = np.arange(1.0, 90.0)
    before = shown(obj, frames)
    for act in (bake, unbake):
        act(targets)
        bpy.context.view_layer.update()
        assert np.abs(shown(obj, frames) - before).max() < 2e-5
    assert strip.action == action


@pytest.mark.parametrize("again", ["bake", "reduce"])
def test_keys_are_changed_again_after_the_original_was_chosen_by_hand(live_file, again):
    rig = key_all(new_rig(), np.arange(1.0, 41.0, 3.0), amount=0.05)
    bones, data = list(rig.pose.bones), rig.animation_data
    set_mode(bones, "dq_sclerp")
    own, slot = data.action, data.action_slot

    def change() -> None:
        if again == "bake":
            bake(bones)
        else:
            reduce_keys_of(bones, "motor_spline", 50.0)
        bpy.context.view_layer.update()

    change()
    first = data.action
    data.action, data.action_slot = own, slot
    bpy.context.view_layer.update()
    change()
    assert data.action not in (own, first)
    counts = {len(curves_of(bone)["location", 0].keyframe_points) for bone in bones}
    assert 14 not in counts
    assert len(bpy.data.actions) == 3
