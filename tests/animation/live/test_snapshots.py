"""Which bones an edit was about, by a snapshot of their rig."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import bpy
import pytest

from rigid_motion.animation import set_enabled
from rigid_motion.animation.actions.slots import Slot, slots_in
from rigid_motion.animation.live.follower import follower
from rigid_motion.animation.live.snapshots import Snapshots
from tests.animation.bones.rigs import key_all, new_rig
from tests.animation.keyed import curves_of

EVERYTHING = {"", "Body", "Upper", "Lower", "Hand"}


@pytest.fixture
def rig(live_file, monkeypatch) -> Iterator[bpy.types.Object]:
    """A rig with keys on all bones, one of which has a single key; a snapshot is taken of it, by no other."""
    set_enabled(False)
    monkeypatch.setattr(follower, "snapshots", Snapshots())
    rig = new_rig()
    key_all(rig)
    for path in ("location", "rotation_quaternion"):
        for frame in (11, 24, 40):
            rig.pose.bones["Hand"].keyframe_delete(path, frame=frame)
    assert edited(rig) == EVERYTHING
    yield rig
    set_enabled(True)


def slot_of(rig: bpy.types.Object) -> Slot:
    (slot,) = slots_in([rig.animation_data.action])
    return slot


def edited(rig: bpy.types.Object) -> set[str]:
    """The names of bones that were edited since the last look, "" for the rig itself; all their F-curves are found."""
    result = follower.snapshots.edited_in(slot_of(rig))
    for place in result:
        if place.prefix:
            there = {(place.prefix + path, index) for path, index in curves_of(place.users[0].carrier)}
            assert place.curves.keys() == there
    return {place.prefix.removeprefix('pose.bones["').removesuffix('"].') for place in result}


def location(rig: bpy.types.Object, bone: str, index: int = 1) -> bpy.types.FCurve:
    return curves_of(rig.pose.bones[bone])["location", index]


def change_a_handle(rig: bpy.types.Object) -> None:
    location(rig, "Lower").keyframe_points[1].handle_right.y += 1.0


def mute(rig: bpy.types.Object) -> None:
    location(rig, "Lower").mute = True


@pytest.mark.parametrize("edit", [change_a_handle, mute], ids=lambda edit: edit.__name__)
def test_a_bone_that_was_edited_is_found_alone_and_once(rig, edit: Callable[[bpy.types.Object], None]):
    assert edited(rig) == set()
    edit(rig)
    assert edited(rig) == {"Lower"}
    assert edited(rig) == set()


def test_a_bone_with_a_modifier_counts_as_edited_until_that_is_gone(rig):
    modifier = location(rig, "Upper").modifiers.new("LIMITS")
    assert edited(rig) == {"Upper"}
    assert edited(rig) == {"Upper"}
    location(rig, "Upper").modifiers.remove(modifier)
    assert edited(rig) == {"Upper"}
    assert edited(rig) == set()


def rename(rig: bpy.types.Object) -> None:
    rig.pose.bones["Lower"].name = "Forearm"


def key_another_property(rig: bpy.types.Object) -> None:
    rig.pose.bones["Lower"].keyframe_insert("scale", frame=1)


@pytest.mark.parametrize("edit", [rename, key_another_property], ids=lambda edit: edit.__name__)
def test_everything_counts_as_edited_where_other_channels_are_there(rig, edit: Callable[[bpy.types.Object], None]):
    edit(rig)
    assert edited(rig) - {"Forearm"} >= EVERYTHING - {"Lower"}
    assert edited(rig) == set()


def test_a_channel_that_was_made_anew_is_found_wherever_it_is_in_memory(rig):
    fcurves = rig.animation_data.action.layers[0].strips[0].channelbag(rig.animation_data.action_slot).fcurves
    fcurve = curves_of(rig.pose.bones["Hand"])["rotation_quaternion", 3]
    path, index = fcurve.data_path, fcurve.array_index
    fcurves.remove(fcurve)
    fcurves.new(path, index=index).keyframe_points.insert(1.0, 0.5)
    assert "Hand" in edited(rig)
    assert edited(rig) == set()


def test_bones_are_noticed_that_are_posed_or_turn_otherwise(rig):
    assert follower.snapshots.changed_bones(rig, 1.0) == list(rig.pose.bones)
    assert follower.snapshots.changed_bones(rig, 1.0) == []
    rig.pose.bones["Body"].location.x += 1e-3
    rig.pose.bones["Hand"].rotation_mode = "ZYX"
    assert [bone.name for bone in follower.snapshots.changed_bones(rig, 1.0)] == ["Body", "Hand"]
    assert follower.snapshots.changed_bones(rig, 1.0) == []


def test_bones_that_another_frame_has_moved_are_not_taken_for_posed(rig):
    bpy.context.scene.frame_set(5)
    follower.snapshots.changed_bones(rig, 5.0)
    bpy.context.scene.frame_set(17)
    rig.pose.bones["Body"].location.x += 1e-3
    rig.pose.bones["Lower"].scale.x = 1.5
    rig.pose.bones["Hand"].rotation_mode = "ZYX"
    assert [bone.name for bone in follower.snapshots.changed_bones(rig, 17.0)] == ["Body", "Lower", "Hand"]
    assert follower.snapshots.changed_bones(rig, 17.0) == []


def test_where_a_channel_is_muted_what_another_frame_shows_is_a_pose(rig):
    location(rig, "Upper").mute = True
    bpy.context.scene.frame_set(5)
    follower.snapshots.changed_bones(rig, 5.0)
    rig.pose.bones["Upper"].location.y = location(rig, "Upper").evaluate(17.0)
    bpy.context.scene.frame_set(17)
    assert [bone.name for bone in follower.snapshots.changed_bones(rig, 17.0)] == ["Upper"]
