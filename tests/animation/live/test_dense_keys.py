"""Bake Keyframes and Bake Channels on live in-betweens keep the motion that was seen."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import key_frames, set_mode
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import editor, key, new_object

FRAMES = range(1, 41)


@pytest.fixture(params=["QUATERNION", "YZX"])
def tool(request, live_file) -> bpy.types.Object:
    """An object that moves by screws, all keys selected."""
    obj = key(new_object(rotation_mode=request.param), scale="even")
    set_mode(obj, "cga_slerp")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    for fcurve in curves_of(obj).values():
        fcurve.select = True
        select(fcurve, FRAMES)
    return obj


def select(fcurve: bpy.types.FCurve, frames) -> None:
    """Have the keys on these frames selected, with their handles, and no others."""
    for point in fcurve.keyframe_points:
        for part in ("select_control_point", "select_left_handle", "select_right_handle"):
            setattr(point, part, point.co.x in frames)


def bake_keyframes():
    with editor("DOPESHEET_EDITOR"):
        bpy.ops.action.bake_keys()
    bpy.context.view_layer.update()


def test_bake_keyframes_keeps_the_motion(tool):
    before = shown_worlds([tool], FRAMES)[0]
    bake_keyframes()
    assert len(key_frames(tool)) == 40
    assert shown_worlds([tool], FRAMES)[0] == pytest.approx(before, abs=2e-5)


def test_where_only_a_channel_is_selected_all_get_keys(tool):
    before = shown_worlds([tool], FRAMES)[0]
    for (path, index), fcurve in curves_of(tool).items():
        select(fcurve, FRAMES if (path, index) == ("location", 0) else ())
    bake_keyframes()
    assert shown_worlds([tool], FRAMES)[0] == pytest.approx(before, abs=2e-5)


def test_between_selected_keys_alone(tool):
    before = shown_worlds([tool], FRAMES)[0]
    for fcurve in curves_of(tool).values():
        select(fcurve, (11.0, 24.0))
    bake_keyframes()
    assert len(key_frames(tool)) == 4 + 12
    # The other segments have their own in-betweens, as before.
    assert shown_worlds([tool], FRAMES)[0] == pytest.approx(before, abs=1e-3)


def test_keys_that_are_not_on_the_curves_stay_as_they_are(tool):
    fcurve = curves_of(tool)["location", 0]
    for frame in (14.0, 17.0):
        fcurve.keyframe_points.insert(frame, 7.0)
    bpy.context.view_layer.update()
    assert [point.co.y for point in fcurve.keyframe_points if point.co.x in (14.0, 17.0)] == [7.0, 7.0]


@pytest.mark.parametrize("remove", [False, True])
def test_bake_channels_keeps_the_motion(tool, remove):
    before = shown_worlds([tool], FRAMES)[0]
    with editor("DOPESHEET_EDITOR"):
        bpy.ops.anim.channels_bake(range=(1, 40), step=1.0, remove_outside_range=remove, interpolation_type="LIN")
    bpy.context.view_layer.update()
    assert shown_worlds([tool], FRAMES)[0] == pytest.approx(before, abs=2e-5)


@pytest.mark.parametrize("shown", [1, 17])
def test_keys_that_are_edited_before_blender_tells_of_bake_channels_stay_as_far_off(tool, shown):
    bpy.context.scene.frame_set(shown)
    before = shown_worlds([tool], FRAMES)[0]
    with editor("DOPESHEET_EDITOR"):
        bpy.ops.anim.channels_bake(range=(1, 40), step=1.0, interpolation_type="LIN")
    fcurve = curves_of(tool)["location", 1]
    for frame in (14, 15, 30):
        (point,) = (one for one in fcurve.keyframe_points if one.co.x == frame)
        point.co_ui.y += 0.25
        before[FRAMES.index(frame), 1, 3] += 0.25
    bpy.context.view_layer.update()
    assert shown_worlds([tool], FRAMES)[0] == pytest.approx(before, abs=2e-5)


def test_where_most_keys_are_off_the_curves_they_stay_as_they_are(tool):
    with editor("DOPESHEET_EDITOR"):
        bpy.ops.anim.channels_bake(range=(1, 40), step=1.0, interpolation_type="LIN")
    fcurve = curves_of(tool)["location", 1]
    for point in fcurve.keyframe_points:
        point.co_ui.y += 0.25
    values = [point.co.y for point in fcurve.keyframe_points]
    bpy.context.view_layer.update()
    assert [point.co.y for point in fcurve.keyframe_points] == values
