"""Which slots move what: every user is found, by itself or in strips, and nothing else."""

from __future__ import annotations

import bpy

from rigid_motion.animation.actions.slots import Slot, slots_in, slots_of
from tests.animation.scenes import key, new_object


def names(slots: list[Slot]) -> list[tuple[str, list[str], set]]:
    """Of each slot its Action, its users, and the frames that strips show of it."""
    return [(slot.action.name, [user.name for user in slot.users], set(slot.strips)) for slot in slots]


def use(obj: bpy.types.Object, owner: bpy.types.Object) -> None:
    """Have one object be moved by the slot of another."""
    data = obj.animation_data_create()
    data.action = owner.animation_data.action
    data.action_slot = owner.animation_data.action_slot


def put_into_strip(obj: bpy.types.Object, action: bpy.types.Action, start: int = 1) -> bpy.types.NlaStrip:
    return obj.animation_data_create().nla_tracks.new().strips.new(action.name, start, action)


def test_all_users_of_a_slot_are_found_by_their_names(live_file):
    owner = key(new_object("M", "QUATERNION"))
    for name in ("Z", "A"):
        use(new_object(name, "QUATERNION"), owner)
    action = owner.animation_data.action
    assert names(slots_in([action])) == names(slots_of([owner])) == [(action.name, ["A", "M", "Z"], {None})]


def test_a_strip_makes_its_object_a_user_with_the_frames_that_it_shows(live_file):
    obj = key(new_object("Tool", "QUATERNION"))
    action, slot = obj.animation_data.action, obj.animation_data.action_slot
    obj.animation_data.action = None
    strip = put_into_strip(obj, action)
    strip.action_slot = slot
    frames = (int(strip.action_frame_start), int(strip.action_frame_end))
    assert names(slots_in([action])) == [(action.name, ["Tool"], {frames})]


def test_slots_of_one_object_come_from_the_bottom_of_its_strips_to_the_top(live_file):
    actions = []
    obj = new_object("Tool", "QUATERNION")
    for name in ("Walk", "Arms", "Turn"):
        key(obj)
        action = obj.animation_data.action
        action.name = name
        actions.append((action, obj.animation_data.action_slot))
        obj.animation_data.action = None
    for action, slot in (actions[2], actions[0], actions[1]):
        put_into_strip(obj, action).action_slot = slot
    in_order = ["Turn", "Walk", "Arms"]
    assert [slot.action.name for slot in slots_in([action for action, _ in actions])] == in_order
    assert [slot.action.name for slot in slots_of([obj])] == in_order


def test_what_a_constraint_shows_of_an_action_does_not_make_its_object_a_user(live_file):
    owner, other = key(new_object("Tool", "QUATERNION")), new_object("Other", "QUATERNION")
    constraint = other.constraints.new("ACTION")
    constraint.action = owner.animation_data.action
    constraint.action_slot = owner.animation_data.action_slot
    assert [user.name for user in slots_in([owner.animation_data.action])[0].users] == ["Tool"]


def test_users_that_were_deleted_are_none(live_file):
    owner, other = key(new_object("Tool", "QUATERNION")), new_object("Other", "QUATERNION")
    use(other, owner)
    bpy.data.objects.remove(other)
    assert [user.name for user in slots_in([owner.animation_data.action])[0].users] == ["Tool"]
    owner.animation_data.action.use_fake_user = True
    action = owner.animation_data.action
    bpy.data.objects.remove(owner)
    assert slots_in([action]) == slots_in([]) == []
