"""Keys inserted in between, where what was on the screen is not what it was at first."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.animation import key_frames, set_mode
from tests.animation.oracle import curves_of, expected_bases
from tests.animation.scenes import key, new_object


@pytest.fixture
def tool(live_file) -> bpy.types.Object:
    """An object that moves by screws, in the middle of a segment."""
    obj = key(new_object())
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(15)
    return obj


def seen() -> np.ndarray:
    bpy.context.view_layer.update()
    return np.array(bpy.data.objects["Tool"].evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_basis)


def pose(x: float, y: float) -> None:
    """Move and turn it by hand."""
    obj = bpy.data.objects["Tool"]
    obj.location.x, obj.rotation_quaternion.y = x, y
    bpy.context.view_layer.update()


def insert(path: str) -> None:
    bpy.data.objects["Tool"].keyframe_insert(path)
    bpy.context.view_layer.update()


def assert_key_has(wanted: np.ndarray) -> None:
    obj = bpy.data.objects["Tool"]
    assert 15.0 in key_frames(obj)
    assert np.abs(expected_bases(obj, [15.0])[0] - wanted).max() < 2e-5
    assert np.abs(seen() - wanted).max() < 2e-5


@pytest.mark.parametrize("path", ["location", "rotation_quaternion"])
def test_a_pose_by_hand_is_given_up_with_the_frame(tool, path):
    wanted = seen()
    pose(5.0, 2.0)
    bpy.context.scene.frame_set(30)
    bpy.context.scene.frame_set(15)
    insert(path)
    assert_key_has(wanted)


def test_a_pose_by_hand_is_given_up_with_an_edit_of_the_action(tool):
    pose(5.0, 2.0)
    fcurve = curves_of(tool)["location", 1]
    fcurve.keyframe_points[1].co_ui.y += 2.0
    fcurve.update()
    wanted = seen()
    insert("location")
    assert_key_has(wanted)


def test_the_same_key_of_another_pose_is_another_key(tool):
    bpy.ops.ed.undo_push(message="Begin")
    pose(5.0, 2.0)
    insert("location")
    bpy.ops.ed.undo_push(message="Key")
    bpy.ops.ed.undo()
    assert 15.0 not in key_frames(bpy.data.objects["Tool"])
    pose(5.0, -1.0)
    wanted = seen()
    insert("location")
    assert_key_has(wanted)


def test_keys_of_the_other_channels_ease_as_the_keys_before_them(tool):
    for (path, _), fcurve in curves_of(tool).items():
        if path in ("location", "rotation_quaternion"):
            fcurve.keyframe_points[1].interpolation, fcurve.keyframe_points[1].easing = "BACK", "EASE_IN_OUT"
            fcurve.update()
    bpy.context.view_layer.update()
    insert("location")
    easings = [
        (point.interpolation, point.easing)
        for (path, _), fcurve in curves_of(tool).items()
        for point in fcurve.keyframe_points
        if path == "rotation_quaternion" and point.co.x == 15.0
    ]
    assert easings == [("BACK", "EASE_IN_OUT")] * 4
