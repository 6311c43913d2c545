"""What is keyed, when, and what goes on outside of the keys: in each case the motion is that of the oracle."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, problem_of, refresh, set_mode, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.keyed import curves_of, key_frames, rotation_path, snapshot
from tests.animation.oracle import assert_shown
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object, own_deltas, random_values

PLAYED = np.arange(-3.0, 46.0)
KINDS = {
    "an empty": lambda: None,
    "a camera": lambda: bpy.data.cameras.new("Camera"),
    "a light": lambda: bpy.data.lights.new("Light", "AREA"),
    "a curve": lambda: bpy.data.curves.new("Curve", "CURVE"),
    "an armature": lambda: bpy.data.armatures.new("Armature"),
}


def set_mode_leaving_keys(obj: bpy.types.Object, mode: str) -> None:
    """Set a mode, which leaves the animator's channels as they were."""
    before = snapshot(obj)
    set_mode(obj, mode)
    assert snapshot(obj) == before
    assert problem_of(obj) == ""
    assert is_filled_in(obj)


def is_filled_in(obj: bpy.types.Object) -> bool:
    return any(path.startswith("delta_") for path, _ in curves_of(obj))


def remove(obj: bpy.types.Object, *channels: tuple[str, int]) -> None:
    """Take channels away; the object rests at a value of its own in them."""
    fcurves = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot).fcurves
    for path, index in channels:
        fcurves.remove(fcurves.find(path, index=index))
        getattr(obj, path)[index] = 0.3 + 0.1 * index


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_object_moves(live_file, kind):
    obj = key(new_object("Tool", "YZX", KINDS[kind]()))
    set_mode_leaving_keys(obj, "dq_sclerp")
    assert_shown([obj], PLAYED)


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
@pytest.mark.parametrize("order", ["QUATERNION", "ZYX"])
def test_keys_off_whole_frames_are_gone_through_on_the_frames_between(live_file, mode, order):
    obj = key(new_object("Tool", order), (0.37, 9.5, 9.9, 10.2, 30.75), scale="even")
    set_mode_leaving_keys(obj, mode)
    assert_shown([obj], PLAYED)


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER", "QUINT"])
@pytest.mark.parametrize("order", ["QUATERNION", "XZY"])
def test_channels_that_are_keyed_on_different_frames_share_all_of_their_keys(live_file, order, interpolation):
    obj = new_object("Tool", order)
    times = {"location": (1.0, 12.0, 40.0), rotation_path(obj): (5.0, 12.0, 22.5, 33.0), "scale": (3.0, 44.0)}
    for path, frames in times.items():
        write_channel(obj, path, np.array(frames), random_values(obj, path, len(frames)), interpolation=interpolation)
    for fcurve in curves_of(obj).values():
        if fcurve.array_index == 1:
            fcurve.keyframe_points[1].co_ui.x += 0.5
    set_mode_leaving_keys(obj, "dq_sclerp")
    assert len(key_frames(obj)) == 10
    assert_shown([obj], PLAYED)


@pytest.mark.parametrize("own", [False, True], ids=["plain", "own deltas"])
@pytest.mark.parametrize(
    "missing",
    [
        [("location", 1)],
        [("rotation_quaternion", 0)],
        [("rotation_quaternion", 2), ("location", 0), ("location", 2)],
        [("location", index) for index in range(3)],
        [("rotation_quaternion", index) for index in range(4)],
    ],
    ids=["one of location", "one of rotation", "a few", "all of location", "all of rotation"],
)
def test_what_is_not_keyed_rests_at_its_value(live_file, missing, own):
    obj = key(new_object())
    remove(obj, *missing)
    owns = {"Tool": give_own_deltas(obj)} if own else {}
    set_mode_leaving_keys(obj, "dq_sclerp")
    assert_shown([obj], PLAYED, owns)
    obj.location, obj.rotation_quaternion = (2.0, -1.0, 0.5), (0.4, -0.3, 0.2, 0.7)
    refresh()
    assert_shown([obj], PLAYED, owns)


def test_a_muted_mode_channel_has_no_say_until_a_mode_is_chosen(live_file):
    obj = key(new_object())
    set_mode(obj, "dq_sclerp")
    set_mode(obj, "pga_lerp", FRAMES[:2])
    channel = curves_of(obj)["rigid_motion.mode", 0]
    channel.mute = True
    refresh()
    assert modes_of(obj, np.array(FRAMES[:-1])) == ["dq_sclerp"] * (len(FRAMES) - 1)
    assert_shown([obj], PLAYED)
    set_mode(obj, "cga_slerp", FRAMES[1:2])
    assert not channel.mute
    assert modes_of(obj, np.array(FRAMES[:3])) == ["dq_sclerp", "cga_slerp", "dq_sclerp"]
    assert_shown([obj], PLAYED)


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY"])
@pytest.mark.parametrize("own", [False, True], ids=["plain", "own deltas"])
def test_scale_that_differs_from_axis_to_axis_stays_blenders_while_the_rest_follows(live_file, order, own):
    obj = key(new_object("Tool", order), scale="uneven", interpolation="SINE")
    owns = {"Tool": give_own_deltas(obj)} if own else {}
    set_mode_leaving_keys(obj, "cga_slerp")
    assert not any(path == "delta_scale" for path, _ in curves_of(obj))
    assert_shown([obj], PLAYED, owns)


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER", "CONSTANT", "SINE"])
def test_linear_extrapolation_goes_on_with_the_rigid_motion(live_file, order, interpolation):
    obj = key(new_object("Tool", order), (5.0, 11.0, 30.5), interpolation=interpolation)
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 45
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
        for point in fcurve.keyframe_points:
            point.handle_left_type = point.handle_right_type = "FREE"
            point.handle_left.y -= 0.1
            point.handle_right.y += 0.1
    before = snapshot(obj)
    set_mode(obj, "dq_sclerp")
    assert snapshot(obj) == before
    assert problem_of(obj) == ""
    assert_shown([obj], np.arange(46.0))
    live_file.scene.frame_end = 70
    bpy.context.view_layer.update()
    assert_shown([obj], np.arange(71.0))


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_linear_extrapolation_goes_on_to_where_a_scene_ends_that_was_made_anew(live_file, kind):
    obj = key(new_object(), (5.0, 11.0, 30.0), interpolation="LINEAR")
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 45
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    bpy.ops.scene.new(type=kind)
    bpy.context.view_layer.update()
    bpy.context.scene.frame_end = 70
    bpy.context.view_layer.update()
    assert_shown(bpy.context.scene.objects, np.arange(71.0))


def share(obj: bpy.types.Object, name: str) -> bpy.types.Object:
    """Another object that moves by the same slot."""
    other = new_object(name, obj.rotation_mode)
    other.animation_data_create().action = obj.animation_data.action
    other.animation_data.action_slot = obj.animation_data.action_slot
    return other


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_objects_that_share_a_slot_move_alike_and_follow_its_edits_together(live_file, order):
    obj = key(new_object("One", order))
    own = give_own_deltas(obj)
    twin, child = share(obj, "Twin"), share(obj, "Child")
    for other in (twin, child):
        give_own_deltas(other)
    child.parent = twin
    owns = dict.fromkeys(("One", "Twin", "Child"), own)
    set_mode(twin, "dq_sclerp")
    assert {other.rigid_motion.mode for other in (obj, twin, child)} == {"dq_sclerp"}
    assert_shown([obj, twin, child], PLAYED, owns)
    curves_of(obj)["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert_shown([obj, twin, child], PLAYED, owns)
    twin.animation_data.action = None
    bpy.context.view_layer.update()
    assert own_deltas(twin) == own, "who leaves the slot has its own delta transforms again"
    assert_shown([obj], PLAYED, owns)


def test_three_slots_of_one_action_have_modes_and_keys_of_their_own(live_file):
    objects = [new_object(name, order) for name, order in (("A", "QUATERNION"), ("B", "XYZ"), ("C", "ZYX"))]
    action = bpy.data.actions.new("Shared")
    for seed, obj in enumerate(objects):
        obj.animation_data_create().action = action
        obj.animation_data.action_slot = action.slots.new("OBJECT", obj.name)
        key(obj, (1.0 + seed, 10.0, 30.0 + seed), seed=seed)
    for obj, mode in zip(objects, ("dq_sclerp", "pga_lerp", "BLENDER"), strict=True):
        set_mode(obj, mode)
    assert len(action.slots) == 3
    assert [is_filled_in(obj) for obj in objects] == [True, True, False]
    assert_shown(objects, PLAYED)
    before = [snapshot(obj) for obj in objects]
    set_mode(objects[2], "lerp_slerp", [10.0])
    assert [snapshot(obj) for obj in objects[:2]] == before[:2]
    assert_shown(objects, PLAYED)
    action.slots.remove(objects[0].animation_data.action_slot)
    bpy.context.view_layer.update()
    assert_shown(objects[1:], PLAYED)


def test_a_driver_on_anything_else_is_no_hindrance(live_file):
    obj = key(new_object())
    obj["grip"] = 1.0
    obj.driver_add('["grip"]').driver.expression = "frame"
    obj.driver_add("hide_render").driver.expression = "frame > 20"
    set_mode_leaving_keys(obj, "dq_sclerp")
    assert_shown([obj], PLAYED)
