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
from tests.animation.oracle import shown_worlds
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
