"""Whole turns between two keys: those that Euler angles say, and those of the channel Turns."""

from __future__ import annotations

from math import tau

import bpy
import numpy as np
import pytest
from mathutils import Euler, Quaternion

from rigid_motion import animation
from rigid_motion.animation import set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion.motion.eulers import ORDERS
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import WIDTHS, curve_of, rotation_path, snapshot
from tests.animation.oracle import assert_shown, shown_worlds
from tests.animation.scenes import give_own_deltas, new_object

FRAMES = (1.0, 13.0, 25.0, 37.0, 49.0, 61.0, 73.0)
EACH = np.arange(1.0, 74.0)


def wheel(angles, mode: str, *, axis: int = 1, order: str = "XYZ", interpolation: str = "LINEAR", frames=FRAMES):
    """An object that rolls along x, turned by these angles about one axis."""
    obj = new_object(rotation_mode=order)
    rotations = np.zeros((len(frames), 3))
    rotations[:, axis] = angles
    write_channel(obj, "rotation_euler", np.array(frames), rotations, interpolation=interpolation)
    set_mode(obj, mode)
    return obj


def turned(obj: bpy.types.Object, frames=EACH) -> np.ndarray:
    """The rotations of an object on frames, as matrices (m, 3, 3)."""
    return shown_worlds([obj], frames)[0][:, :3, :3]


def rotations(angles, axis: int) -> np.ndarray:
    """Turns by angles (m,) about one of the axes of space, as matrices (m, 3, 3)."""
    cosines, sines = np.cos(angles), np.sin(angles)
    result = np.zeros((len(sines), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result[:, axis, axis] = 1.0
    result[:, i, i] = result[:, j, j] = cosines
    result[:, j, i], result[:, i, j] = sines, -sines
    return result


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
@pytest.mark.parametrize("axis", range(3))
def test_three_turns_between_two_keys_are_the_angle_over_time(live_file, mode, order, axis):
    obj = wheel((0.0, -3.0 * tau), mode, order=order, axis=axis, frames=(1.0, 73.0))
    assert np.abs(turned(obj) - rotations(-3.0 * tau * (EACH - 1.0) / 72.0, axis)).max() < 1e-5


def propeller(mode: str, *, interpolation: str = "LINEAR", frames=(1.0, 25.0, 49.0), moves: bool = True, angle=0.7):
    """An object that turns by quaternions about a slanted axis, and moves along a bent path unless told not to."""
    obj = new_object()
    axis = np.array((1.0, 2.0, 2.0)) / 3.0
    halves = 0.5 * angle * np.arange(len(frames))
    quaternions = np.column_stack((np.cos(halves), np.outer(np.sin(halves), axis)))
    write_channel(obj, "rotation_quaternion", np.array(frames), quaternions, interpolation=interpolation)
    if moves:
        places = np.column_stack((np.arange(len(frames)), np.arange(len(frames)) % 2, np.zeros(len(frames))))
        write_channel(obj, "location", np.array(frames), places, interpolation=interpolation)
    set_mode(obj, mode)
    return obj


@pytest.mark.parametrize("turns", [3, -2])
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_turns_are_made_about_the_screws_axis_and_the_origin_stays_on_its_path(live_file, mode, turns):
    obj = propeller(mode)
    before = shown_worlds([obj], EACH[:49])[0]
    set_turns(obj, turns, [1.0])
    after = shown_worlds([obj], EACH[:49])[0]
    assert np.abs(after[:, :3, 3] - before[:, :3, 3]).max() < 1e-5
    axis = before[0, :3, :3] @ (1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0)
    for frame in range(49):
        share = min(frame / 24.0, 1.0)
        spun = np.array(Quaternion(axis, tau * turns * share).to_matrix())
        assert np.abs(after[frame, :3, :3] - spun @ before[frame, :3, :3]).max() < 1e-5


@pytest.mark.parametrize(("mode", "axis"), in_turn(KEYFRAME_MODES, ["SCREW", "X", "Y", "Z"]))
def test_what_does_not_turn_between_its_keys_spins_about_a_local_axis(live_file, mode, axis):
    obj = propeller(mode, frames=(1.0, 25.0), moves=False, angle=0.0)
    tilt = Euler((0.4, -0.2, 0.9)).to_quaternion()
    write_channel(obj, "rotation_quaternion", np.array((1.0, 25.0)), np.tile(tilt, (2, 1)), interpolation="LINEAR")
    set_mode(obj, mode)
    set_turns(obj, 2, [1.0], axis=axis)
    expected = np.array(tilt.to_matrix()) @ rotations(2.0 * tau * np.arange(25) / 24.0, "XYZ".find(axis) % 3)
    assert np.abs(turned(obj, EACH[:25]) - expected).max() < 1e-5


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY"])
@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_lerp", "motor_spline"])
def test_what_has_no_keys_of_its_rotation_spins_as_well(live_file, mode, order):
    obj = new_object(rotation_mode=order)
    own = {obj.name: give_own_deltas(obj, seed=3)}
    write_channel(obj, "location", np.array((1.0, 25.0, 49.0)), np.eye(3), interpolation="BEZIER")
    set_mode(obj, mode)
    set_turns(obj, 2, [1.0])
    for angles in ((0.4, -0.2, 0.9), (1.4, 0.3, -2.0)):
        obj.rotation_euler, obj.rotation_quaternion = angles, Euler(angles).to_quaternion()
        bpy.context.view_layer.update()
        assert_shown([obj], EACH[:49], own)
    keyed, (shown,) = snapshot(obj), shown_worlds([obj], EACH[:49])
    animation.bake(obj)
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - shown).max() < 2e-5
    animation.unbake(obj)
    assert snapshot(obj) == keyed
    assert_shown([obj], EACH[:49], own)
    set_turns(obj, 0, [1.0])
    assert_shown([obj], EACH[:49], own)


def insert(obj: bpy.types.Object, frame: int) -> None:
    """Key an object's location and rotation on a frame, as I does with the playhead there."""
    bpy.context.scene.frame_set(frame)
    for path in ("location", rotation_path(obj)):
        obj.keyframe_insert(path)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER"])
@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, (*ORDERS, "AXIS_ANGLE")))
def test_any_angles_turn_as_the_oracle_has_it(live_file, mode, order, interpolation):
    obj, frames = new_object(rotation_mode=order), (1.0, 17.0, 25.0, 49.0)
    own = give_own_deltas(obj, seed=5)
    for path, size in (("location", 0.5), (rotation_path(obj), 4.0)):
        values = size * np.random.default_rng(len(order)).normal(size=(4, WIDTHS[path]))
        if order == "AXIS_ANGLE" and path != "location":
            # Far round about one axis, and the shortest way to another one.
            values[:3, 1:] = values[0, 1:]
        write_channel(obj, path, np.array(frames), values, interpolation=interpolation)
    set_mode(obj, mode)
    set_turns(obj, 2, [17.0])
    assert_shown([obj], np.arange(1.0, 49.0, 0.625), {obj.name: own})


def test_the_property_is_that_of_the_segment_on_the_frame(live_file):
    obj = propeller("dq_sclerp")
    bpy.context.scene.frame_set(30)
    obj.rigid_motion.turns = 2
    keys = curve_of(obj, "rigid_motion.turns").keyframe_points
    assert [tuple(key.co) for key in keys] == [(1.0, 0.0), (25.0, 2.0), (49.0, 0.0)]
    bpy.context.scene.frame_set(10)
    assert obj.rigid_motion.turns == 0
    bpy.context.scene.frame_set(30)
    obj.rigid_motion.turns = 0
    assert curve_of(obj, "rigid_motion.turns") is None


def test_what_has_no_mode_refuses_turns(live_file):
    obj = propeller("BLENDER")
    with pytest.raises(animation.Refused, match="choose a mode first"):
        set_turns(obj, 2, [1.0])
    assert curve_of(obj, "rigid_motion.turns") is None


@pytest.mark.parametrize(("turns", "axis"), [(3, "SCREW"), (-2, "SCREW"), (2, "X")])
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_keys_in_between_keep_the_path_of_what_moves(live_file, mode, turns, axis):
    obj = propeller(mode)
    set_turns(obj, turns, [1.0], axis=axis)
    before = shown_worlds([obj], EACH[:49])[0]
    for frame in (13, 7, 16):
        insert(obj, frame)
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 1e-4


def test_without_the_key_in_between_turns_are_whole_again(live_file):
    obj = propeller("dq_sclerp")
    set_turns(obj, 3, [1.0])
    before = shown_worlds([obj], EACH[:49])[0]
    insert(obj, 10)
    keys = curve_of(obj, "rigid_motion.turns").keyframe_points
    assert keys[0].co[1] != round(keys[0].co[1])
    for path in ("location", "rotation_quaternion", "rigid_motion.turns"):
        for index in range(4):
            curve = curve_of(obj, path, index)
            for key in [] if curve is None else [key for key in curve.keyframe_points if key.co[0] == 10.0]:
                curve.keyframe_points.remove(key)
    bpy.context.view_layer.update()
    assert curve_of(obj, "rigid_motion.turns").keyframe_points[0].co[1] == 3.0
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 1e-5


@pytest.mark.parametrize(
    ("turns", "axis", "problem"), [(1001, None, "-1000 to 1000"), (0.5, None, "whole"), (1, "W", "SCREW")]
)
def test_what_are_no_turns_is_refused(live_file, turns, axis, problem):
    obj = propeller("dq_sclerp")
    with pytest.raises(animation.Refused, match=problem):
        set_turns(obj, turns, [1.0], axis=axis)
    assert curve_of(obj, "rigid_motion.turns") is None


def test_too_many_turns_of_the_channel_are_told(live_file):
    obj = propeller("dq_sclerp")
    set_turns(obj, 1, [1.0])
    curve_of(obj, "rigid_motion.turns").keyframe_points[0].co_ui.y = 1e6
    bpy.context.view_layer.update()
    assert "key 1 of the channel Turns" in animation.problem_of(obj)


def test_keys_that_were_inserted_while_nothing_was_followed_leave_turns_alone(live_file):
    obj = propeller("dq_sclerp")
    set_turns(obj, 3, [1.0])
    animation.unregister()
    for path, count in (("location", 3), ("rotation_quaternion", 4)):
        for index in range(count):
            curve_of(obj, path, index).keyframe_points.insert(9.0, 0.25 * index)
    before = snapshot(obj)
    animation.register()
    bpy.context.view_layer.update()
    live_file.scene.frame_set(17)
    assert snapshot(obj) == before
