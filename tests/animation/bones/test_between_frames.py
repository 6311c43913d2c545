"""What is between whole frames: bones are where their modes have them, whatever the rotation, and keys are hit."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import expected_poses, shown_poses
from tests.animation.bones.rigs import ORDERS, in_turn, key_all, new_rig
from tests.animation.oracle import curves_of

PROMISE = 1e-4
"""Metres."""

EIGHTHS = np.arange(8 * 1.0, 8 * 40.0 + 1.0) / 8.0


def largest_error(rig: bpy.types.Object, frames: np.ndarray, reach: float = 0.15) -> dict[str, float]:
    """How far any bone's head, or a point so far from it along its axes, is off."""
    (shown,) = shown_poses([rig], frames)
    wanted = expected_poses(rig, frames)
    found = {}
    for name in wanted:
        points = np.concatenate((np.zeros((1, 3)), reach * np.eye(3)))
        one, other = (m[name][:, None, :3, :3] @ points[:, :, None] + m[name][:, None, :3, 3:] for m in (shown, wanted))
        found[name] = float(np.linalg.norm(one - other, axis=2).max())
    return found


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
def test_bones_are_right_between_frames(live_file, mode, order):
    rig = key_all(new_rig(rotation_mode=order))
    set_mode(list(rig.pose.bones), mode)
    bpy.context.view_layer.update()
    errors = largest_error(rig, EIGHTHS)
    assert max(errors.values()) < PROMISE, errors


OFF_WHOLE_FRAMES = (1.3, 10.5, 10.85, 16.4, 40.0)


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
def test_keys_off_whole_frames_are_hit(live_file, mode, order):
    rig = key_all(new_rig(rotation_mode=order), OFF_WHOLE_FRAMES)
    set_mode(list(rig.pose.bones), mode)
    bpy.context.view_layer.update()
    errors = largest_error(rig, np.array(OFF_WHOLE_FRAMES))
    assert max(errors.values()) < 2e-5, errors
    errors = largest_error(rig, EIGHTHS)
    assert max(errors.values()) < PROMISE, errors


def test_an_edit_of_a_key_off_whole_frames_is_followed(live_file):
    rig = key_all(new_rig(), OFF_WHOLE_FRAMES)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    bpy.context.view_layer.update()
    for number, (frame, value) in enumerate(((16.4, 0.3), (12.3, 0.1), (12.0, 0.0), (16.6, 0.2))):
        for bone in rig.pose.bones:
            for (path, index), fcurve in curves_of(bone).items():
                if path.endswith("location"):
                    fcurve.keyframe_points[3].co_ui = frame, value * (index + 1)
        bpy.context.view_layer.update()
        errors = largest_error(rig, np.sort([*OFF_WHOLE_FRAMES, frame]))
        assert max(errors.values()) < 2e-5, (number, errors)
        assert refresh() == 0
