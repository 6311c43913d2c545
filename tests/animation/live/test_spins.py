"""Whole turns between two keys: those that Euler angles say, and those of the channel Turns."""

from __future__ import annotations

from math import pi, tau

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion.motion.eulers import ORDERS
from tests.animation.oracle import rotation_path, shown_worlds
from tests.animation.scenes import new_object

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
    found = np.zeros((len(sines), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, i, i] = found[:, j, j] = cosines
    found[:, j, i], found[:, i, j] = sines, -sines
    return found


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_keys_at_every_half_turn_turn_three_times_one_way(live_file, mode, sense):
    obj = wheel(sense * pi * np.arange(7), mode)
    lerp = mode in ("pga_lerp", "cga_lerp")
    found, even = turned(obj), rotations(sense * tau * 3.0 * (EACH - 1.0) / 72.0, 1)
    if lerp:
        # Slower at the keys, but the same on keys and half-way.
        found, even = found[::6], even[::6]
    assert np.abs(found - even).max() < 1e-5
    steps = np.einsum("mij,mij->m", turned(obj)[1:], turned(obj)[:-1])
    assert np.all(np.arccos(np.clip((steps - 1.0) / 2.0, -1.0, 1.0)) > 0.02)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
@pytest.mark.parametrize("axis", range(3))
def test_three_turns_between_two_keys_are_the_angle_over_time(live_file, mode, order, axis):
    obj = wheel((0.0, -3.0 * tau), mode, order=order, axis=axis, frames=(1.0, 73.0))
    assert np.abs(turned(obj) - rotations(-3.0 * tau * (EACH - 1.0) / 72.0, axis)).max() < 1e-5


@pytest.mark.parametrize("interpolation", ["BEZIER", "SINE", "BACK"])
def test_a_spin_is_eased_as_its_angle(live_file, interpolation):
    obj = wheel((0.3, 0.3 + 5.0 * tau), "dq_sclerp", interpolation=interpolation, frames=(1.0, 73.0))
    curve = obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves.find("rotation_euler", index=1)
    angles = np.array([curve.evaluate(frame) for frame in EACH])
    assert np.abs(turned(obj) - rotations(angles, 1)).max() < 1e-5


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
        spun = np.array(__import__("mathutils").Quaternion(axis, tau * turns * share).to_matrix())
        assert np.abs(after[frame, :3, :3] - spun @ before[frame, :3, :3]).max() < 1e-5


@pytest.mark.parametrize("axis", ["SCREW", "X", "Y", "Z"])
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
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


@pytest.mark.parametrize("frame", [3, 9, 13, 20])
@pytest.mark.parametrize("turns", [1, 3, -2])
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_a_key_in_between_shares_the_turns_out(live_file, mode, turns, frame):
    obj = propeller(mode, moves=False)
    set_turns(obj, turns, [1.0])
    before = turned(obj, EACH[:49])
    insert(obj, frame)
    after = turned(obj, EACH[:49])
    assert np.abs(after[[0, frame - 1, 24, 48]] - before[[0, frame - 1, 24, 48]]).max() < 1e-5
    if mode not in ("pga_lerp", "cga_lerp", "motor_spline"):
        assert np.abs(after - before).max() < 1e-4


@pytest.mark.parametrize("frame", [3, 9, 20])
def test_a_key_in_between_euler_keys_keeps_their_turns(live_file, frame):
    obj = wheel((0.0, 3.0 * tau), "dq_sclerp", frames=(1.0, 25.0))
    before = turned(obj, EACH[:25])
    bpy.context.scene.frame_set(frame)
    obj.keyframe_insert("rotation_euler")
    bpy.context.view_layer.update()
    assert np.abs(turned(obj, EACH[:25]) - before).max() < 1e-5
