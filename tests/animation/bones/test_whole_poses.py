"""Poses that are put on bones as a whole between two keys: what was put there is seen, and what is keyed."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, set_mode
from tests.animation.bones.poses import placed
from tests.animation.bones.rigs import key_all, new_rig, own_clipboard, pose_mode
from tests.animation.keyed import curves_of, rotation_path

BETWEEN = 15
ORDERS = ("QUATERNION", "XYZ")


@pytest.fixture(params=ORDERS)
def rig(request, live_file) -> bpy.types.Object:
    """A rig in Pose Mode with a mode on each of its bones, in the middle of a segment."""
    rig = key_all(new_rig(rotation_mode=request.param))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    live_file.scene.frame_set(BETWEEN)
    return pose_mode(rig)


def insert_keys(rig: bpy.types.Object) -> None:
    for bone in rig.pose.bones:
        for path in ("location", rotation_path(bone)):
            bone.keyframe_insert(path)


def apply_visual_transform(rig: bpy.types.Object) -> None:
    assert bpy.ops.pose.visual_transform_apply() == {"FINISHED"}


def as_an_animator(operator: Callable, **settings: object) -> None:
    """With undo, and so as Blender keeps in mind which operator it was."""
    assert operator("EXEC_DEFAULT", True, **settings) == {"FINISHED"}


@pytest.mark.parametrize("by", ["animator", "script"])
def test_the_visual_transform_applied_leaves_bones_where_they_are(rig, live_file, by):
    seen = placed(rig)
    if by == "script":
        apply_visual_transform(rig)
    else:
        as_an_animator(bpy.ops.pose.visual_transform_apply)
    assert np.abs(placed(rig) - seen).max() < 2e-5
    insert_keys(rig)
    assert np.abs(placed(rig) - seen).max() < 2e-5
    for bone in rig.pose.bones:
        assert float(BETWEEN) in key_frames(bone)
    live_file.scene.frame_set(BETWEEN + 1)
    live_file.scene.frame_set(BETWEEN)
    assert np.abs(placed(rig) - seen).max() < 2e-5


@pytest.mark.parametrize("keyed", ["at once", "later"])
@pytest.mark.parametrize("applied", [False, True], ids=["as it is", "with the visual transform applied"])
def test_rigify_keeps_a_transform_where_it_is_seen_when_a_parent_is_switched(rig, live_file, applied, keyed):
    """What its switches do: matrices as they are, the switch, and each matrix set again.

    Those of limbs take the matrices with constraints; *Switch Parent* takes that of the properties alone, in which what
    is seen has to be.
    """
    # Its functions alone: as an add-on it would leave classes behind, which the tests of its human register anew.
    tools = importlib.import_module("rigify.utils.animation")
    seen, hand = placed(rig), rig.pose.bones["Hand"]
    if applied:
        apply_visual_transform(rig)
    matrix = tools.get_transform_matrix(rig, "Hand", with_constraints=not applied)
    # The switch: what the hand hangs on is elsewhere from now on.
    switch = hand.parent.constraints.new("COPY_ROTATION")
    switch.target, switch.subtarget = rig, "Body"
    switch.owner_space = switch.target_space = "POSE"
    assert np.abs(placed(rig)[3] - seen[3]).max() > 0.1
    flags = set() if keyed == "at once" else None
    tools.set_transform_from_matrix(rig, "Hand", matrix, keyflags=flags)
    assert np.abs(placed(rig)[3] - seen[3]).max() < 2e-5
    insert_keys(rig)
    assert np.abs(placed(rig)[3] - seen[3]).max() < 2e-5
    live_file.scene.frame_set(BETWEEN + 1)
    live_file.scene.frame_set(BETWEEN)
    assert np.abs(placed(rig)[3] - seen[3]).max() < 2e-5


def test_where_one_property_of_a_whole_pose_is_keyed_so_is_the_rest(rig):
    seen = placed(rig)
    apply_visual_transform(rig)
    placed(rig)
    for bone in rig.pose.bones:
        bone.keyframe_insert("location")
    assert np.abs(placed(rig) - seen).max() < 2e-5
    bone = rig.pose.bones["Body"]
    assert len(curves_of(bone)[rotation_path(bone), 0].keyframe_points) == 5


def test_undo_brings_back_a_whole_pose_as_it_was_seen(rig, live_file, tmp_path):
    live_file.scene.frame_set(24)
    copied = placed(rig)
    with own_clipboard(tmp_path):
        as_an_animator(bpy.ops.pose.copy)
        live_file.scene.frame_set(BETWEEN)
        bpy.ops.ed.undo_push(message="Begin")
        as_an_animator(bpy.ops.pose.paste)
    assert np.abs(placed(rig) - copied).max() < 2e-5
    as_an_animator(bpy.ops.pose.transforms_clear)
    assert np.abs(placed(rig) - np.array([bone.bone.matrix_local for bone in rig.pose.bones])).max() < 1e-6
    with bpy.context.temp_override(mode="OBJECT"):
        assert bpy.ops.ed.undo() == {"FINISHED"}
    rig = bpy.data.objects["Rig"]
    assert np.abs(placed(rig) - copied).max() < 2e-5
    insert_keys(rig)
    assert np.abs(placed(rig) - copied).max() < 2e-5
