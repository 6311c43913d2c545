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
from tests.animation.keyed import curve_of, rotation_path, snapshot
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
    set_turns(obj, 2, [1.0], axis=axis)
    expected = np.array(tilt.to_matrix()) @ rotations(2.0 * tau * np.arange(25) / 24.0, "XYZ".find(axis) % 3)
    assert np.abs(turned(obj, EACH[:25]) - expected).max() < 1e-5


def insert(obj: bpy.types.Object, frame: int) -> None:
    """Key an object's location and rotation on a frame, as I does with the playhead there."""
    bpy.context.scene.frame_set(frame)
    for path in ("location", rotation_path(obj)):
        obj.keyframe_insert(path)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER"])
@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
def test_any_angles_turn_as_the_oracle_has_it(live_file, mode, order, interpolation):
    obj, frames = new_object(rotation_mode=order), (1.0, 17.0, 25.0, 49.0)
    own = give_own_deltas(obj, seed=5)
    for path, size in (("location", 0.5), ("rotation_euler", 4.0)):
        values = size * np.random.default_rng(ORDERS.index(order)).normal(size=(4, 3))
        write_channel(obj, path, np.array(frames), values, interpolation=interpolation)
    set_mode(obj, mode)
    set_turns(obj, 2, [17.0])
    assert_shown([obj], EACH[:49], {obj.name: own})


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
def test_a_bake_has_the_turns_and_undoing_it_brings_them_back(live_file, mode):
    obj = propeller(mode)
    set_turns(obj, 3, [1.0])
    before = shown_worlds([obj], EACH[:49])[0]
    animation.bake(obj)
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 1e-5
    assert [key.co[1] for key in curve_of(obj, "rigid_motion.turns").keyframe_points] == [3.0, 0.0]
    animation.unbake(obj)
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 1e-5


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_fewer_keys_of_what_spins_keep_to_the_tolerance(live_file, order):
    if order == "XYZ":
        obj = wheel((0.0, 3.0 * tau), "dq_sclerp", frames=(1.0, 73.0))
    else:
        obj = propeller("dq_sclerp", frames=(1.0, 73.0))
        set_turns(obj, 3, [1.0])
    before = shown_worlds([obj], EACH)[0]
    animation.bake(obj)
    animation.reduce_keys_of(obj, "dq_sclerp", tolerance=0.002, radius=0.5)
    assert len(animation.key_frames(obj)) < 45
    after = shown_worlds([obj], EACH)[0]
    for corner in 0.5 * np.vstack((np.zeros(3), np.eye(3), -np.eye(3))):
        moved = after[:, :3, :3] @ corner + after[:, :3, 3] - before[:, :3, :3] @ corner - before[:, :3, 3]
        assert np.linalg.norm(moved, axis=1).max() < 0.002 + 1e-5


@pytest.mark.parametrize("after", ["REPEAT", "REPEAT_OFFSET", "MIRROR"])
@pytest.mark.parametrize("axis", ["SCREW", "X"])
def test_cycles_repeat_turns(live_file, axis, after):
    obj = propeller("dq_sclerp", frames=(1.0, 9.0, 17.0))
    set_turns(obj, 1, [1.0], axis=axis)
    for index in range(4):
        curve = curve_of(obj, "rotation_quaternion", index)
        curve.modifiers.new("CYCLES").mode_after = after
    for index in range(3):
        curve_of(obj, "location", index).modifiers.new("CYCLES").mode_after = after
    bpy.context.view_layer.update()
    frames = np.arange(1.0, 17.0)
    first = turned(obj, frames)
    second = turned(obj, 34.0 - frames if after == "MIRROR" else frames[1:] + 16.0)
    if after != "REPEAT_OFFSET":
        first = first if after == "MIRROR" else first[1:]
        assert np.abs(second - first).max() < 1e-4


def test_the_property_is_that_of_the_segment_on_the_frame(live_file):
    obj = propeller("dq_sclerp")
    bpy.context.scene.frame_set(30)
    obj.rigid_motion.turns = 2
    keys = curve_of(obj, "rigid_motion.turns").keyframe_points
    assert [tuple(key.co) for key in keys] == [(1.0, 0.0), (25.0, 2.0), (49.0, 0.0)]
    bpy.context.scene.frame_set(10)
    assert obj.rigid_motion.turns == 0
    set_turns(obj, 0)
    assert curve_of(obj, "rigid_motion.turns") is None
    bpy.context.scene.frame_set(30)
    assert obj.rigid_motion.turns == 0


def test_what_has_no_mode_refuses_turns(live_file):
    obj = propeller("BLENDER")
    with pytest.raises(animation.Refused, match="choose a mode first"):
        set_turns(obj, 2, [1.0])
    assert curve_of(obj, "rigid_motion.turns") is None


@pytest.mark.parametrize("frames", [(13, 7, 16)])
@pytest.mark.parametrize(("turns", "axis"), [(3, "SCREW"), (-2, "SCREW"), (2, "X")])
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_keys_in_between_keep_the_path_of_what_moves(live_file, mode, turns, axis, frames):
    obj = propeller(mode)
    set_turns(obj, turns, [1.0], axis=axis)
    before = shown_worlds([obj], EACH[:49])[0]
    for frame in frames:
        insert(obj, frame)
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 1e-4


@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "motor_spline"])
def test_keys_all_along_have_no_turns_of_their_own(live_file, mode):
    """As Blender's Bake Action sets them: the values of the curves, on every frame."""
    obj = propeller(mode)
    set_turns(obj, 2, [1.0])
    before = shown_worlds([obj], EACH[:49])[0]
    for path, count in (("location", 3), ("rotation_quaternion", 4)):
        for index in range(count):
            curve = curve_of(obj, path, index)
            values = [(frame, curve.evaluate(frame)) for frame in range(1, 50)]
            for frame, value in values:
                curve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
    bpy.context.view_layer.update()
    assert np.abs(shown_worlds([obj], EACH[:49])[0] - before).max() < 2e-4


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


@pytest.mark.parametrize("order", ["QUATERNION", "YZX"])
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_parts_of_turns_are_as_the_oracle_has_them(live_file, mode, order):
    if order == "QUATERNION":
        obj = propeller(mode)
        set_turns(obj, 2, [1.0])
    else:
        obj = wheel((0.0, 2.0 * tau + 1.0), mode, order=order, frames=(1.0, 25.0))
        write_channel(obj, "location", np.array((1.0, 25.0)), np.array(((0, 0, 0), (4, 1, 0))), interpolation="LINEAR")
    insert(obj, 10)
    insert(obj, 16)
    if mode not in ("lerp_slerp",):
        values = [key.co[1] for key in curve_of(obj, "rigid_motion.turns").keyframe_points]
        assert any(abs(value - round(value)) > 0.01 for value in values)
    assert_shown([obj], EACH[:25])


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
