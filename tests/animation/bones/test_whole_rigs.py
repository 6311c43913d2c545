"""Whole rigs: how often the F-curves of a slot are looked through does not depend on how many bones are at it."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import pytest

from rigid_motion.animation import bake, set_mode
from rigid_motion.animation.actions import slots
from tests.animation.bones.rigs import Rest, key_all, new_rig
from tests.animation.scenes import push_down
from tests.blank import blank

Edit = Callable[[], object]


def rig_of(count: int) -> bpy.types.Object:
    """A file with a rig of so many bones, side by side, all of which have a mode."""
    blank()
    rests = [Rest(f"Bone {number}", (number, 0.0, 0.0), (number, 0.0, 1.0)) for number in range(count)]
    rig = key_all(new_rig("Rig", rests))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    bpy.context.view_layer.update()
    return rig


def clearing(rig: bpy.types.Object) -> Edit:
    return lambda: set_mode(list(rig.pose.bones), "BLENDER")


def baking(rig: bpy.types.Object) -> Edit:
    return lambda: bake(list(rig.pose.bones))


def inserting(rig: bpy.types.Object) -> Edit:
    def insert() -> None:
        for bone in rig.pose.bones:
            bone.keyframe_insert("location", frame=17)
            bone.keyframe_insert("rotation_quaternion", frame=17)

    bpy.context.scene.frame_set(17)
    bpy.context.view_layer.update()
    return insert


def making_a_strip(rig: bpy.types.Object) -> Edit:
    copy = push_down(rig).action.copy()

    def make() -> None:
        strip = rig.animation_data.nla_tracks.new().strips.new("Copy", 200, copy)
        strip.action_slot = copy.slots[0]

    return make


@pytest.mark.parametrize(
    "prepared",
    [clearing, baking, inserting, making_a_strip],
    ids=lambda p: p.__name__,
)
def test_f_curves_are_looked_through_as_often_for_many_bones_as_for_few(live_file, monkeypatch, prepared):
    scans: list[int] = []
    look = slots._curves_under
    monkeypatch.setattr(slots, "_curves_under", lambda *which: scans.append(1) or look(*which))
    counts = []
    for bones in (3, 9):
        edit = prepared(rig_of(bones))
        scans.clear()
        edit()
        bpy.context.view_layer.update()
        counts.append(len(scans))
    assert counts[0] == counts[1] > 0
