"""Copies and assets of poses on an in-between: what is seen is what they have."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, refresh, set_mode
from rigid_motion.animation.live.follower import show_seen_in_channels
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.panels import facts_and_notes
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import Rest, key_all, new_rig, pose_mode, select_bones
from tests.animation.keyed import curve_of, rotation_path

BETWEEN, OTHER = 15, 33
SIDES = [Rest(f"Hand.{side}", (x, 0.0, 1.0), (2 * x, 0.1, 1.2)) for side, x in (("L", 0.3), ("R", -0.3))]
FLIP = np.diag((-1.0, 1.0, 1.0, 1.0))
"""The mirror that bones have their other side in."""


@pytest.fixture(params=["QUATERNION", "XYZ"])
def rig(request, extension) -> bpy.types.Object:
    """A rig with a hand on each side and modes on both, on an in-between of the left one, which is selected."""
    rig = key_all(new_rig("Rig", SIDES, request.param))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    pose_mode(rig, "Hand.L")
    extension.scene.frame_set(BETWEEN)
    return rig


def key_pose(rig: bpy.types.Object, name: str) -> None:
    bone = rig.pose.bones[name]
    for path in ("location", rotation_path(bone)):
        bone.keyframe_insert(path)


@pytest.mark.parametrize("side", ["L", "R"], ids=["as it is", "flipped"])
def test_a_copied_pose_is_pasted_as_it_was_seen(rig, extension, side):
    copied, name = seen(rig, "Hand.L"), f"Hand.{side}"
    expected = copied if side == "L" else FLIP @ copied @ FLIP
    assert bpy.ops.rigid_motion.copy_pose("EXEC_DEFAULT", True) == {"FINISHED"}
    assert np.abs(seen(rig, "Hand.L") - copied).max() < 1e-5
    extension.scene.frame_set(OTHER)
    assert np.abs(seen(rig, name) - expected).max() > 0.1
    bpy.ops.pose.paste("EXEC_DEFAULT", True, flipped=side == "R")
    assert np.abs(seen(rig, name) - expected).max() < 2e-5
    key_pose(rig, name)
    assert OTHER in key_frames(rig.pose.bones[name])
    assert np.abs(seen(rig, name) - expected).max() < 2e-5
    extension.scene.frame_set(BETWEEN)
    assert BETWEEN not in key_frames(rig.pose.bones[name])


def test_an_asset_has_the_pose_that_was_seen(rig, extension):
    expected = seen(rig, "Hand.L")
    made = set(bpy.data.actions)
    # What the operator does, whose dialog asks for a name and a library.
    show_seen_in_channels([transform_of(rig.pose.bones["Hand.L"])])
    settings = {"pose_name": "Reach", "asset_library_reference": "LOCAL"}
    assert bpy.ops.poselib.create_pose_asset("EXEC_DEFAULT", True, **settings) == {"FINISHED"}
    (asset,) = set(bpy.data.actions) - made
    assert asset.asset_data is not None
    assert np.abs(seen(rig, "Hand.L") - expected).max() < 1e-5
    extension.scene.frame_set(OTHER)
    rig.pose.apply_pose_from_action(asset)
    assert np.abs(seen(rig, "Hand.L") - expected).max() < 2e-5


def test_a_pose_pasted_where_a_channel_is_muted_stays_until_the_frame_changes(rig, extension):
    bone = rig.pose.bones["Hand.L"]
    path = rotation_path(bone)
    curve_of(bone, path, 1).mute = True
    bpy.context.view_layer.update()
    copied = seen(rig, "Hand.L")
    bpy.ops.rigid_motion.copy_pose("EXEC_DEFAULT", True)
    extension.scene.frame_set(OTHER)
    bpy.ops.pose.paste("EXEC_DEFAULT", True)
    for _ in range(2):
        assert np.abs(seen(rig, "Hand.L") - copied).max() < 2e-5
        extension.view_layer.update()
    assert facts_and_notes(bone, OTHER)[1] == []
    value = getattr(bone, path)[1]
    extension.scene.frame_set(BETWEEN)
    assert getattr(bone, path)[1] == value
    assert refresh() == 0  # In-betweens go by the value of the muted channel.


@pytest.mark.parametrize("name", ["copy_pose", "create_pose_asset"])
def test_on_a_key_and_without_a_mode_blender_s_own_operator_acts(rig, extension, name):
    operator = getattr(bpy.ops.rigid_motion, name)
    assert operator.poll()
    extension.scene.frame_set(24)
    assert not operator.poll()
    extension.scene.frame_set(BETWEEN)
    set_mode(rig.pose.bones["Hand.L"], "BLENDER")
    extension.view_layer.update()
    assert not operator.poll()
    select_bones(rig, "Hand.R")
    assert operator.poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not operator.poll()


@pytest.mark.parametrize("then", ["the frame changes", "it is keyed"])
def test_a_channel_without_keys_has_its_value_back(rig, extension, then):
    bone = rig.pose.bones["Hand.L"]
    channelbag = rig.animation_data.action.layers[0].strips[0].channelbag(rig.animation_data.action_slot)
    channelbag.fcurves.remove(channelbag.fcurves.find('pose.bones["Hand.L"].location', index=1))
    bone.location.y = 0.25
    extension.scene.frame_set(BETWEEN + 1)
    extension.scene.frame_set(BETWEEN)
    bpy.ops.rigid_motion.copy_pose("EXEC_DEFAULT", True)
    assert abs(bone.location.y - 0.25) > 1e-3
    extension.view_layer.update()
    if then == "it is keyed":
        bone.keyframe_insert("location", index=0)
        extension.view_layer.update()
    else:
        extension.scene.frame_set(OTHER)
    assert bone.location.y == 0.25
