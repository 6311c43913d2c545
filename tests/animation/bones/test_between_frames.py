"""What is between whole frames: bones are where their modes have them, whatever the rotation, and keys are hit."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import expected_poses, shown_poses
from tests.animation.bones.rigs import ORDERS, in_turn, key_all, moving_rig, new_rig
from tests.animation.keyed import curves_of

PROMISE = 1e-4
"""Metres."""

EIGHTHS = np.arange(8 * 1.0, 8 * 40.0 + 1.0) / 8.0


def largest_error(rig: bpy.types.Object, frames: np.ndarray, reach: float = 0.15) -> dict[str, float]:
    """How far any bone's head, or a point so far from it along its axes, is off."""
    (shown,) = shown_poses([rig], frames)
    expected = expected_poses(rig, frames)
    result = {}
    for name in expected:
        points = np.concatenate((np.zeros((1, 3)), reach * np.eye(3)))
        one, other = (
            m[name][:, None, :3, :3] @ points[:, :, None] + m[name][:, None, :3, 3:] for m in (shown, expected)
        )
        result[name] = float(np.linalg.norm(one - other, axis=2).max())
    return result


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
def test_bones_are_right_between_frames(live_file, mode, order):
    rig = key_all(new_rig(rotation_mode=order))
    set_mode(list(rig.pose.bones), mode)
    assert_right_between_frames(rig)


def assert_right_between_frames(rig: bpy.types.Object, *hit: float) -> None:
    """Every bone is where it has to be, on these frames more exactly."""
    bpy.context.view_layer.update()
    errors = largest_error(rig, np.array(hit or EIGHTHS[:1]))
    assert max(errors.values()) < 2e-5, errors
    errors = largest_error(rig, EIGHTHS)
    assert max(errors.values()) < PROMISE, errors


OFF_WHOLE_FRAMES = (1.3, 10.5, 10.85, 16.4, 40.0)


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
@pytest.mark.parametrize("part", range(len(OFF_WHOLE_FRAMES) - 1))
def test_a_single_segment_with_a_mode_may_begin_and_end_off_whole_frames(live_file, part, order):
    rig = key_all(new_rig(rotation_mode=order), OFF_WHOLE_FRAMES)
    set_mode(list(rig.pose.bones), "dq_sclerp", [OFF_WHOLE_FRAMES[part]])
    assert_right_between_frames(rig, *OFF_WHOLE_FRAMES)


def test_a_key_edited_far_from_a_mode_that_ends_off_whole_frames_is_followed(live_file):
    rig = key_all(new_rig(), OFF_WHOLE_FRAMES)
    set_mode(list(rig.pose.bones), "dq_sclerp", [OFF_WHOLE_FRAMES[0], OFF_WHOLE_FRAMES[1]])
    bpy.context.view_layer.update()
    assert max(record.rate for record in rig.animation_data.action.rigid_motion.slots) > 1
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[-1].co_ui.y += 0.1
    assert_right_between_frames(rig)
    assert refresh() == 0


def test_a_manual_frame_range_of_the_animators_stays_and_one_that_is_unticked_comes_back(live_file):
    rig = moving_rig()
    bpy.context.view_layer.update()
    action = rig.animation_data.action

    def edit() -> None:
        curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += 0.1
        bpy.context.view_layer.update()

    action.use_frame_range = False
    edit()
    assert action.use_frame_range
    assert tuple(action.frame_range) == (1.0, 40.0)
    set_mode(list(rig.pose.bones), "BLENDER")
    assert not action.use_frame_range
    action.use_frame_range, action.frame_start, action.frame_end = True, 5.0, 30.0
    set_mode(list(rig.pose.bones), "dq_sclerp")
    edit()
    assert tuple(action.frame_range) == (5.0, 30.0)


def test_slow_motions_have_one_sample_a_frame(live_file):
    rig = key_all(new_rig(), (1.0, 200.0, 400.0), amount=0.1)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    action = rig.animation_data.action
    assert {record.rate for record in action.rigid_motion.slots} == {1}
    assert not action.use_frame_range
    errors = largest_error(rig, np.arange(1.0, 400.0, 5.3))
    assert max(errors.values()) < PROMISE, errors
