"""Blender's own *Bake Action*, with its defaults and without: the motion that was seen is what it keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rigs import moving_rig, pose_mode, select_only
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds, world_now
from tests.animation.scenes import give_own_deltas, key, new_object, push_down

PLAYED = np.arange(1.0, 41.0)
CASES = [("QUATERNION", False), ("QUATERNION", True), ("XYZ", False), ("AXIS_ANGLE", False)]
"""How an object turns, and whether it has delta transforms: Blender itself bakes those of Euler angles wrongly."""

ELSEWHERE = 15
"""A frame between two keys, which is shown while all is baked."""

DEFAULTS: dict[str, object] = {"frame_start": 1, "frame_end": 40}
"""What an animator sees who presses the button: Blender fills in the frames, and Pose Mode the type."""


def moving(order: str = "QUATERNION", *, own: bool = False) -> bpy.types.Object:
    obj = new_object("Tool", order)
    if own:
        give_own_deltas(obj)
    key(obj, scale="even")
    set_mode(obj, "cga_lerp")
    return obj


def bake_object(obj: bpy.types.Object, **settings: object) -> None:
    select_only(obj)
    bpy.context.scene.frame_set(ELSEWHERE)
    assert bpy.ops.nla.bake(**DEFAULTS | {"bake_types": {"OBJECT"}} | settings) == {"FINISHED"}


def assert_as_before(obj: bpy.types.Object, before: np.ndarray) -> None:
    # Without a frame change first: what is on the screen now.
    now = world_now()
    assert np.abs(now - shown_worlds([obj], [float(ELSEWHERE)])[0][0]).max() < 1e-5
    error = np.abs(shown_worlds([obj], PLAYED)[0] - before).max()
    assert error < 1e-5 * max(1.0, np.abs(before).max()), f"off by {error}"


@pytest.mark.parametrize("settings", [{"use_current_action": True}, {"visual_keying": True}], ids=str)
@pytest.mark.parametrize(("order", "own"), CASES)
def test_a_baked_object_moves_as_before(live_file, order, own, settings):
    obj = moving(order, own=own)
    before = shown_worlds([obj], PLAYED)[0]
    bake_object(obj, **settings)
    assert_as_before(obj, before)


def test_an_object_baked_above_its_strip_moves_as_before(live_file):
    obj = moving(own=True)
    push_down(obj, 1)
    before = shown_worlds([obj], PLAYED)[0]
    bake_object(obj)
    assert len(obj.animation_data.nla_tracks) == 1
    assert_as_before(obj, before)


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_of_a_rig_the_selected_bones_are_baked(live_file, order):
    rig = moving_rig(rotation_mode=order)
    before = shown_poses([rig], PLAYED)[0]
    pose_mode(rig, "Body")
    bpy.context.scene.frame_set(ELSEWHERE)
    assert bpy.ops.nla.bake(**DEFAULTS, bake_types={"POSE"}, use_current_action=True) == {"FINISHED"}
    keys = [len(curves_of(rig.pose.bones[name])["location", 0].keyframe_points) for name in ("Body", "Hand")]
    assert keys == [40, 4]
    after = shown_poses([rig], PLAYED)[0]
    assert max(np.abs(after[bone] - before[bone]).max() for bone in before) < 2e-5
