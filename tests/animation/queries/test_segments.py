"""The facts reported about the segment at a frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, repeat, set_enabled, set_mode, set_turns, write_channel
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.animation.queries.segments import frame_in_action, is_up_to_date, segment_at
from tests.animation.scenes import push_down, turning, tweak

FRAMES = np.array((1.0, 11.0, 31.0))


def turned(degrees, frames=FRAMES, **how):
    return turning("Tool", degrees, frames, **how)


def at(obj, frame):
    return segment_at(source_of(obj), frame)


LONG, EULERS = {"degrees": (0, 90, 120), "sign": -1.0}, {"degrees": (0, 350, 380), "rotation_mode": "XYZ"}

FACTS = {
    **{
        order: ({"rotation_mode": order}, 5, {"first": 1, "last": 11, "key": 1, "turn": 90, "distance": 2, "turns": 0})
        for order in ("QUATERNION", "XYZ", "ZXY")
    },
    "nothing amiss": ({}, 5, {"long_way": False, "scales_unevenly": False, "is_sure": False, "two_axes": False}),
    "before a key": ({}, 10.9, {"first": 1}),
    "on a key that begins it": ({}, 11, {"first": 11}),
    "on a key that ends it": ({}, 31, {"first": 11}),
    "as far as angles say": (EULERS, 5, {"turn": 350, "turns": 1, "is_sure": True, "long_way": False}),
    "a small angle": (EULERS, 20, {"turns": 0, "is_sure": False, "two_axes": False}),
    "the long way in Blender": (LONG, 5, {"long_way": True}),
    "a full turn through nothing": ({"degrees": (0, 0, 0), "sign": -1.0}, 5, {"long_way": False}),
    "nothing before the keys": ({}, 0, None),
    "nothing behind them": ({}, 32, None),
    "nothing with a single one": ({"degrees": (0,), "frames": FRAMES[:1]}, 1, None),
}
"""The rotation of an object, a frame, and the facts reported about the segment there, if any, angles in degrees."""


@pytest.mark.parametrize("what", FACTS)
def test_a_segment_is_told_in_numbers(live_file, what):
    settings, frame, facts = FACTS[what]
    segment = at(turned(**{"degrees": (0, 90, 120), **settings}), frame)
    assert (segment is None) == (facts is None)
    told = {name: np.degrees(segment.turn) if name == "turn" else getattr(segment, name) for name in facts or ()}
    assert told == pytest.approx(facts or {}, abs=1e-3)


def test_what_changes_the_turn_or_the_scale_is_told_where_it_does_so(live_file):
    obj, angles = turned((0, 90, 120)), [(0, 0, 0), (200, 0, 350), (250, 0, 380)]
    set_mode(obj, "dq_sclerp")
    set_turns(obj, -2, [1.0])
    assert [at(obj, frame).turns for frame in (5, 20)] == [-2, 0]
    assert np.degrees(at(obj, 5).turn) == pytest.approx(630.0, abs=1e-3)
    for scales, uneven in (
        ([(1, 1, 1), (1, 2, 1), (1, 2, 1)], [True, False]),
        (np.outer((1, 2, 1), (1,) * 3), [False] * 2),
    ):
        write_channel(obj, "scale", FRAMES, scales)
        assert [at(obj, frame).scales_unevenly for frame in (5, 20)] == uneven
    obj.rotation_mode = "XYZ"
    write_channel(obj, "rotation_euler", FRAMES, np.radians(angles))
    assert [at(obj, frame).two_axes for frame in (5, 20)] == [True, False]


@pytest.mark.parametrize(("mode", "ends"), [("REPEAT", (41.0, 61.0)), ("MIRROR", (31.0, 51.0))])
def test_a_segment_that_a_cycle_repeats_hangs_on_the_key_it_is_a_copy_of(live_file, mode, ends):
    obj = turned((0, 90, 120))
    repeat(obj, mode)
    own, again = at(obj, 5), at(obj, 30 + 20)
    assert (own.first, own.last, again.first, again.last, again.key) == (1.0, 11.0, *ends, 11.0)
    assert (np.degrees(again.turn), again.distance) == pytest.approx((30.0, 2.0), abs=0.01)


def test_in_tweak_mode_frames_are_those_of_the_strip(live_file):
    obj = turned((0, 90, 120))
    assert frame_in_action(obj, 5.0) == 5.0
    tweak(obj, push_down(obj, 101))
    assert frame_in_action(obj, 105.0) == pytest.approx(5.0)


def test_in_betweens_are_out_of_date_while_an_edit_is_not_followed(live_file):
    obj = turned((0, 90, 120))
    assert is_up_to_date(obj, source_of(obj))
    set_mode(obj, "dq_sclerp")
    assert is_up_to_date(obj, source_of(obj))
    set_enabled(False)
    write_channel(obj, "location", FRAMES, np.eye(3))
    bpy.context.view_layer.update()
    assert not is_up_to_date(obj, source_of(obj))
    set_enabled(True)
    refresh()
    assert is_up_to_date(obj, source_of(obj))
