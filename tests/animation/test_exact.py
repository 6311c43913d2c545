"""Precision of in-betweens: at any time, far from frame 0, with any timing, and in the channels themselves."""

from __future__ import annotations

from itertools import cycle

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.oracle import expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object
from tests.balls import displaced

ORDERS = ("QUATERNION", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
EIGHTHS = np.arange(FRAMES[0] - 1.0, FRAMES[-1] + 1.0, 0.125)
SHIFTS = (0.0, -5000.0, 100_000.0)
TIMINGS = ("LINEAR", "BEZIER", "SINE", "CUBIC", "EXPO", "BACK", "CIRC", "BOUNCE", "ELASTIC", "CONSTANT")
BETWEEN, ON_FRAMES = 1e-4, 1e-5
"""Allowed errors in metres between frames and on frames, within 1 m of the origin of an object that moves by metres."""


@pytest.mark.parametrize(
    ("how", "where"),
    in_turn(zip(cycle(ORDERS), TIMINGS, strict=False), [*zip(KEYFRAME_MODES, cycle(SHIFTS), cycle((False, True)))]),
)
def test_every_mode_is_exact_at_any_time_with_any_timing(live_file, how, where):
    """Also with a parent and delta transforms."""
    (order, timing), (mode, shift, placed) = how, where
    obj = new_object("Tool", order)
    if placed and order != "AXIS_ANGLE":
        give_own_deltas(obj)
        obj.parent = new_object("Parent", "XYZ")
        obj.parent.location, obj.parent.rotation_euler = (1.0, 2.0, -0.5), (0.3, -0.4, 1.0)
    key(obj, np.array(FRAMES) + shift, interpolation=timing)
    set_mode(obj, mode)
    bpy.context.view_layer.update()
    off = displaced(shown_worlds([obj], EIGHTHS + shift)[0], expected_worlds(obj, EIGHTHS + shift), 1.0)
    assert off.max() < BETWEEN
    assert off[::8].max() < ON_FRAMES
    assert refresh() == 0
    frame = 7.375 + shift
    live_file.scene.frame_set(int(np.floor(frame)), subframe=frame % 1.0)
    np.testing.assert_allclose(obj.matrix_world, expected_worlds(obj, [frame])[0], rtol=0.0, atol=ON_FRAMES)
