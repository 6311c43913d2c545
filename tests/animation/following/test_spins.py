"""Whole turns between two keys: from Euler angles, and from the channel Turns."""

from __future__ import annotations

from math import tau

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Quaternion

from rigid_motion import animation
from rigid_motion.animation import set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion.motion.eulers import ORDERS
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import WIDTHS, curve_of, curves_of, rotation_path, snapshot
from tests.animation.oracle import assert_shown, shown_worlds
from tests.animation.scenes import give_own_deltas, new_object

EACH = np.arange(1.0, 50.0)


def rotations(angles, axis: int) -> np.ndarray:
    """Return rotations by angles (m,) about one of the space axes, as matrices (m, 3, 3)."""
    return np.array([Matrix.Rotation(angle, 3, "XYZ"[axis]) for angle in angles])


def shown(obj: bpy.types.Object, frames=EACH) -> np.ndarray:
    """Return the displayed matrices (m, 4, 4) of an object on frames."""
    return shown_worlds([obj], frames)[0]


@pytest.mark.parametrize(("mode", "about"), in_turn(KEYFRAME_MODES, [*zip(ORDERS, (0, 1, 2, 0, 1, 2), strict=True)]))
def test_three_turns_between_two_keys_are_the_angle_over_time(live_file, mode, about):
    order, axis = about
    obj = new_object(rotation_mode=order)
    ends = np.zeros((2, 3))
    ends[1, axis] = -3.0 * tau
    write_channel(obj, "rotation_euler", EACH[[0, -1]], ends, interpolation="LINEAR")
    set_mode(obj, mode)
    assert np.abs(shown(obj)[:, :3, :3] - rotations(-3.0 * tau * (EACH - 1.0) / 48.0, axis)).max() < 1e-5
    assert not any(curve.modifiers for curve in curves_of(obj).values()), "about a single axis nothing is added"


def propeller(mode: str) -> bpy.types.Object:
    """Return an object that turns by quaternions about a slanted axis, and moves along a bent path."""
    obj, frames = new_object(), EACH[::24]
    turned = [Quaternion((1.0, 2.0, 2.0), angle) for angle in (0.0, 0.7, 1.4)]
    write_channel(obj, "rotation_quaternion", frames, np.array(turned), interpolation="LINEAR")
    write_channel(obj, "location", frames, np.array(((0, 0, 0), (1, 1, 0), (2, 0, 0))), interpolation="LINEAR")
    set_mode(obj, mode)
    return obj


@pytest.mark.parametrize("turns", [3, -2])
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_turns_are_made_about_the_screws_axis_and_the_origin_stays_on_its_path(live_file, mode, turns):
    obj = propeller(mode)
    before = shown(obj)
    set_turns(obj, turns, [1.0])
    after = shown(obj)
    assert np.abs(after[:, :3, 3] - before[:, :3, 3]).max() < 1e-5
    axis = before[0, :3, :3] @ (1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0)
    for frame in range(49):
        share = min(frame / 24.0, 1.0)
        spun = np.array(Quaternion(axis, tau * turns * share).to_matrix())
        assert np.abs(after[frame, :3, :3] - spun @ before[frame, :3, :3]).max() < 1e-5


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_what_does_not_turn_between_its_keys_spins_about_a_local_axis(live_file, mode):
    obj, tilt = new_object(), Euler((0.4, -0.2, 0.9)).to_quaternion()
    write_channel(obj, "rotation_quaternion", EACH[[0, 24]], np.tile(tilt, (2, 1)), interpolation="LINEAR")
    set_mode(obj, mode)
    for axis in ("X", "Y", "Z", "SCREW"):
        set_turns(obj, 2, [1.0], axis=axis)
        expected = np.array(tilt.to_matrix()) @ rotations(2.0 * tau * np.arange(25) / 24.0, "XYZ".find(axis) % 3)
        assert np.abs(shown(obj, EACH[:25])[:, :3, :3] - expected).max() < 1e-5


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY"])
@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_lerp", "motor_spline"])
def test_what_has_no_keys_of_its_rotation_spins_as_well(live_file, mode, order):
    obj = new_object(rotation_mode=order)
    give_own_deltas(obj, seed=3)
    write_channel(obj, "location", np.array((1.0, 25.0, 49.0)), np.eye(3), interpolation="BEZIER")
    set_mode(obj, mode)
    set_turns(obj, 2, [1.0])
    for angles in ((0.4, -0.2, 0.9), (1.4, 0.3, -2.0)):
        obj.rotation_euler, obj.rotation_quaternion = angles, Euler(angles).to_quaternion()
        bpy.context.view_layer.update()
        assert_shown([obj], EACH)
    set_turns(obj, 0, [1.0])
    assert_shown([obj], EACH)


def insert(obj: bpy.types.Object, frame: int) -> None:
    """Key an object's location and rotation on a frame, as I does with the playhead there."""
    bpy.context.scene.frame_set(frame)
    for path in ("location", rotation_path(obj)):
        obj.keyframe_insert(path)
    bpy.context.view_layer.update()


@pytest.mark.parametrize(("order", "mode"), in_turn((*ORDERS, "AXIS_ANGLE"), [*KEYFRAME_MODES]))
def test_any_angles_turn_as_the_oracle_has_it(live_file, mode, order):
    interpolation = "LINEAR" if KEYFRAME_MODES[mode].is_smooth else "BEZIER"
    obj, frames = new_object(rotation_mode=order), (1.0, 17.0, 25.0, 49.0)
    give_own_deltas(obj, seed=5)
    for path, size in (("location", 0.5), (rotation_path(obj), 4.0)):
        values = size * np.random.default_rng(len(order)).normal(size=(4, WIDTHS[path]))
        if order == "AXIS_ANGLE" and path != "location":
            # Several turns about one axis, then the shortest way to another axis.
            values[:3, 1:] = values[0, 1:]
        write_channel(obj, path, np.array(frames), values, interpolation=interpolation)
    set_mode(obj, mode)
    set_turns(obj, 2, [17.0])
    assert_shown([obj], np.arange(1.0, 49.0, 0.625))


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


@pytest.mark.parametrize(("turns", "axis"), [(3, "SCREW"), (-2, "SCREW"), (2, "X")])
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp", "pga_slerp", "cga_slerp"])
def test_keys_in_between_keep_the_path_and_without_them_turns_are_whole_again(live_file, mode, turns, axis):
    obj = propeller(mode)
    set_turns(obj, turns, [1.0], axis=axis)
    before = shown(obj)
    for frame in (13, 7, 16):
        insert(obj, frame)
    assert np.abs(shown(obj) - before).max() < 1e-4
    keys = curve_of(obj, "rigid_motion.turns").keyframe_points
    if mode == "lerp_slerp":
        # Its turns stay whole; only fractional turns are merged again.
        return
    assert keys[0].co[1] % 1.0
    for curve in curves_of(obj).values():
        for key in [key for key in reversed(curve.keyframe_points) if key.co[0] in (7.0, 13.0, 16.0)]:
            curve.keyframe_points.remove(key)
    bpy.context.view_layer.update()
    assert curve_of(obj, "rigid_motion.turns").keyframe_points[0].co[1] == turns
    assert np.abs(shown(obj) - before).max() < 1e-5


@pytest.mark.parametrize(
    ("mode", "turns", "axis", "problem"),
    [
        ("dq_sclerp", 1001, None, "-1000 to 1000"),
        ("dq_sclerp", 0.5, None, "whole"),
        ("dq_sclerp", 1, "W", "SCREW"),
        ("BLENDER", 2, None, "choose a mode first"),
    ],
)
def test_what_are_no_turns_or_has_no_mode_is_refused(live_file, mode, turns, axis, problem):
    obj = propeller(mode)
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
    for (_, index), curve in curves_of(obj).items():
        curve.keyframe_points.insert(9.0, 0.25 * index)
    before = snapshot(obj)
    animation.register()
    bpy.context.view_layer.update()
    live_file.scene.frame_set(17)
    assert snapshot(obj) == before
