"""Location, rotation and scale with keys on different frames: a key of any is one of the whole body."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, rotation_path
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object, random_values, write_channel

FRAMES = (7.0, 11.0, 24.0, 40.0, 52.0, 60.0, 75.0)


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ("QUATERNION", "XYZ", "AXIS_ANGLE")))
@pytest.mark.parametrize("kind", ["BEZIER", "breakdowns", "muted", "LINEAR"])
def test_keys_of_parts_are_keys_of_the_body(live_file, mode, order, kind):
    """With easing and breakdowns, with a muted channel, and where a part goes on behind its keys between others'."""
    random, obj = np.random.default_rng(len(kind) + len(mode)), new_object("Tool", order)
    for path, last in (("location", 60.0), (rotation_path(obj), 75.0), ("scale", 75.0)):
        some = np.array([frame for frame in FRAMES if frame <= last and random.random() < 0.75])
        values = random_values(obj, path, len(some), 3, True)
        write_channel(obj, path, some, values, interpolation="SINE" if kind == "breakdowns" else "BEZIER")
    on, curves = random.choice(FRAMES[1:-1], 2), list(curves_of(obj).values())
    curves[random.integers(len(curves))].mute = kind == "muted"
    for fcurve in curves:
        fcurve.extrapolation = "LINEAR" if kind == "LINEAR" else "CONSTANT"
        for point in fcurve.keyframe_points:
            point.type = "BREAKDOWN" if kind == "breakdowns" and point.co.x in on else "KEYFRAME"
    live_file.scene.frame_start = 0
    set_mode(obj, mode)
    assert_shown([obj], np.arange(0.0, 80.0, 2.25))


def test_keys_of_what_no_mode_fills_shape_no_path(live_file):
    """Breakdowns lie on it also where a channel of an uneven scale has keys on the same frames as others."""
    obj = key(new_object("Tool"), FRAMES, scale="uneven")
    set_mode(obj, "motor_spline")
    for (path, index), fcurve in curves_of(obj).items():
        (point,) = (point for point in fcurve.keyframe_points if point.co.x == 24.0)
        if path != "scale":
            point.type = "BREAKDOWN"
        elif index < 2:
            fcurve.keyframe_points.remove(point)
        fcurve.update()
    refresh()
    assert_shown([obj], np.arange(7.0, 75.0, 2.25))
