"""What animators do with Actions all day: unlink, swap, share, reuse, delete. Nothing stale stays on any object."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import key_frames, modes_of, problem_of, read_poses, set_mode
from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown
from tests.animation.scenes import FRAMES, key, new_object

PLAYED = np.arange(-2.0, 44.0)


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER"])
def test_an_action_that_goes_on_outside_of_its_keys_is_no_longer_for_it(live_file, interpolation):
    live_file.scene.frame_end = 250
    obj = key(new_object(), (1.0, 50.0, 100.0), interpolation=interpolation)
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    set_mode(obj, "dq_sclerp")
    action, slot = obj.animation_data.action, obj.animation_data.action_slot
    assert tuple(action.frame_range) == (1.0, 100.0)
    assert_shown([obj], np.arange(1.0, 251.0))
    obj.animation_data.action = None
    strip = obj.animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    strip.action_slot = slot
    assert (strip.frame_start, strip.frame_end) == (1.0, 100.0)
    set_mode(obj, "BLENDER")
    assert not action.use_frame_range


def test_a_frame_range_that_the_animator_has_set_stays(live_file):
    obj = key(new_object(), (-10.0, 5.0, 20.0))
    action = obj.animation_data.action
    action.use_frame_range, action.frame_start, action.frame_end = True, -3.0, 9.0
    set_mode(obj, "dq_sclerp")
    assert_shown([obj], np.arange(-12.0, 23.0))
    set_mode(obj, "BLENDER")
    assert (action.use_frame_range, action.frame_start, action.frame_end) == (True, -3.0, 9.0)


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


def test_many_objects_get_a_mode_at_once_and_what_refuses_is_named(live_file):
    objects = [key(new_object(f"Tool {number}"), seed=number) for number in range(4)]
    objects[2].rotation_mode = "AXIS_ANGLE"
    with pytest.raises(animation.Refused, match="Tool 2 turns by axis and angle"):
        set_mode(objects, "dq_sclerp")
    assert {obj.rigid_motion.mode for obj in objects} == {"BLENDER"}
    refused: list = []
    set_mode(objects, "dq_sclerp", refused=refused)
    assert [str(refusal)[:6] for refusal in refused] == ["Tool 2"]
    assert [obj.rigid_motion.mode for obj in objects] == ["dq_sclerp", "dq_sclerp", "BLENDER", "dq_sclerp"]
    assert_shown([obj for obj in objects if obj.rotation_mode == "QUATERNION"], PLAYED)
    animation.bake([obj for obj in objects if obj.rotation_mode == "QUATERNION"])
    animation.unbake(objects, refused=refused)
    assert [str(refusal)[:6] for refusal in refused] == ["Tool 2", "Tool 2"]
    assert len(bpy.data.actions) == 4


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
    """As Shift D does it, until they are moved apart."""
    obj = key(new_object("Tool", "QUATERNION"), interpolation="LINEAR")
    set_mode(obj, mode)
    before = read_poses(obj, np.arange(1.0, 41.0))
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
    after = read_poses(obj, np.arange(1.0, 41.0))
    np.testing.assert_allclose(after.positions, before.positions, atol=1e-5)
    np.testing.assert_allclose(after.quaternions, before.quaternions, atol=1e-5)
