"""Everyday edits of Actions: unlink, swap, share, reuse, delete. Objects keep nothing stale."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, modes_of, problem_of, set_mode
from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown, shown_worlds
from tests.animation.scenes import FRAMES, key, new_object

PLAYED = np.arange(-2.0, 44.0)


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_linear_extrapolation_goes_on_to_where_a_scene_ends_that_was_made_anew(live_file, kind):
    obj = key(new_object(), (5.0, 11.0, 30.0), interpolation="LINEAR")
    action = obj.animation_data.action
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 45
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    set_mode(obj, "dq_sclerp")
    assert tuple(action.frame_range) == (5.0, 30.0), "an Action that goes on is no longer for it"
    assert_shown([obj], np.arange(46.0))
    bpy.ops.scene.new(type=kind)
    bpy.context.view_layer.update()
    bpy.context.scene.frame_end = 70
    bpy.context.view_layer.update()
    assert_shown(bpy.context.scene.objects, np.arange(71.0))


def test_a_mode_that_was_chosen_before_there_were_keys_waits_for_them(live_file):
    obj = new_object()
    obj.rigid_motion.mode = "pga_lerp"
    set_mode(other := new_object("Other"), "cga_lerp")
    for waiting, mode in ((obj, "pga_lerp"), (other, "cga_lerp")):
        key(waiting)
        bpy.context.view_layer.update()
        assert modes_of(waiting, np.array(FRAMES[:1])) == [mode]
        assert_shown([waiting], PLAYED)
        waiting.animation_data.action = None
        bpy.context.view_layer.update()
        key(waiting, seed=3)
        bpy.context.view_layer.update()
        assert modes_of(waiting, np.array(FRAMES[:1])) == ["BLENDER"], "it was for the first Action"


def test_what_is_deleted_with_an_edit_of_it_still_to_be_seen_is_asked_for_nothing_more(live_file):
    for number in range(30):
        obj = key(new_object(f"Tool {number}"), seed=number)
        set_mode(obj, "dq_sclerp")
        obj.location.x += 1.0
        bpy.data.objects.remove(obj)
        if number % 2:
            live_file.scene.frame_set(number)
        else:
            bpy.context.view_layer.update()
    assert not live_file.scene.objects


@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_lerp", "motor_spline"])
def test_two_keys_on_one_frame_leave_a_mode_to_the_object(live_file, mode):
    """Shift D does this, until the keys are moved apart."""
    obj = key(new_object("Tool", "QUATERNION"), interpolation="LINEAR")
    set_mode(obj, mode)
    (before,) = shown_worlds([obj], PLAYED)
    for fcurve in curves_of(obj).values():
        if fcurve.keyframe_points:
            keys = fcurve.keyframe_points
            keys.add(1)
            keys[-1].co, keys[-1].interpolation = keys[1].co, "LINEAR"
            keys.sort()
            fcurve.update()
    bpy.context.view_layer.update()
    assert problem_of(obj) == ""
    assert key_frames(obj).tolist() == [1.0, 11.0, 24.0, 40.0]
    np.testing.assert_allclose(shown_worlds([obj], PLAYED)[0], before, atol=1e-5)
