"""Channel differences: what modes add to channels does not depend on which frames are asked for, and has no jumps."""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.evaluation.components import ROTATION, ROWS, SCALE
from rigid_motion.animation.evaluation.differences import channel_differences
from rigid_motion.animation.evaluation.sources import KeyedTransform
from rigid_motion.animation.evaluation.spans import spans
from rigid_motion.animation.fcurves.keys import Cycles
from rigid_motion.animation.queries.keyed import source_of
from tests.animation.bones.rigs import ORDERS
from tests.animation.keyed import curve_of, curves_of, rotation_path
from tests.animation.scenes import FRAMES, key, new_object, random_values, write

WHOLE = {"QUATERNION": slice(3, 7), "AXIS_ANGLE": slice(4, 7)}
"""The rows of the quaternion or the axis, whose length runs evenly from key to key."""


def channels(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return the expected values of the channels, (10, m)."""
    ((difference, native),) = channel_differences([source], [frames])
    unfilled = [row for row in range(10) if row not in source.filled_rows]
    assert not difference[unfilled].any()
    assert SCALE in source.keyed or not difference[ROWS[SCALE]].any()
    return difference + native


def keyed_at(obj: bpy.types.Object, frame: float) -> np.ndarray:
    """Return the location and rotation that the channels have on a frame with a key."""
    bpy.context.scene.frame_set(int(frame))
    return np.array((*obj.location, *getattr(obj, rotation_path(obj))))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "cga_lerp"])
def test_values_are_continuous_from_the_first_key_on_whichever_frames_are_asked_for(live_file, order, mode):
    for seed in range(6):
        obj = key(new_object("Tool", order), seed=seed, interpolation="LINEAR")
        path = rotation_path(obj)
        # Far from gimbal lock, where angles may jump.
        write(obj, path, np.array(FRAMES), 0.7 * random_values(obj, path, len(FRAMES), seed))
        set_mode(obj, mode)
        source = source_of(obj)
        for span in spans(source):
            frames = np.concatenate(((span.first + 1e-3,), np.linspace(span.first, span.last, 602)[1:-1]))
            rows, (begin, end) = channels(source, frames), [keyed_at(obj, key) for key in (span.first, span.last)]
            np.testing.assert_allclose(rows[: len(begin), 0], begin, atol=5e-3)
            assert np.abs(np.diff(rows[ROWS[ROTATION]], axis=1)).max() < 0.3
            if order in WHOLE and mode == "dq_sclerp":
                lengths = [np.linalg.norm(values[WHOLE[order]]) for values in (begin, end)]
                evenly = np.interp(frames, (span.first, span.last), lengths)
                np.testing.assert_allclose(np.linalg.norm(rows[WHOLE[order]], axis=0), evenly, atol=1e-6)
            # The values do not depend on the other frames requested in the same call.
            for some in (frames[400:], frames[[17, 550]], frames[[300]]):
                np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-9)


@pytest.mark.parametrize("order", ORDERS[1:-1])
def test_keys_at_gimbal_lock_begin_alike_whichever_frames_are_asked_for(live_file, order):
    obj = key(new_object("Tool", order), seed=3, interpolation="LINEAR")
    middle = curve_of(obj, "rotation_euler", "XYZ".index(order[1]))
    for point, sign in zip(middle.keyframe_points, (1.0, 1.0, -1.0, 1.0), strict=True):
        point.co_ui.y = sign * np.pi / 2.0
    set_mode(obj, "motor_spline")
    source, steps = source_of(obj), np.arange(1, 60) / 60.0
    frames = np.concatenate([first + (last - first) * steps for first, last in itertools.pairwise(FRAMES)])
    rows = channels(source, frames)
    for some in (frames[::7], frames[[10]], frames[[100, 130]]):
        np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-6)


@pytest.mark.parametrize(("end", "repeats"), [((0.0, 0.0, 1.0), True), ((0.0, 2.0, 1.0), False)])
def test_rounds_with_an_offset_are_alike_about_a_single_axis(live_file, end, repeats):
    obj = new_object("Tool", "XYZ")
    write(obj, "rotation_euler", np.array((1.0, 20.0)), np.array(((0.0, 0.0, 0.0), end)))
    for fcurve in curves_of(obj).values():
        add_cycles(fcurve, Cycles("REPEAT", "REPEAT_OFFSET", 0, 0))
    assert source_of(obj).is_repeatable == repeats
