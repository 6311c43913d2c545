"""Actions in NLA strips, however they are placed, stretched, repeated and blended: at any time what Blender makes of
channels that have the motion.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, problem_of, refresh, set_mode
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of
from tests.animation.oracle import expected_bases, shown_worlds
from tests.animation.scenes import key, key_densely, new_object, new_strip, push_down, tweak

KEYS = (1.0, 11.0, 21.0, 41.0)
LENGTH = KEYS[-1] - KEYS[0]
ACTION_FRAMES = np.arange(KEYS[0], KEYS[-1] + 1.0)
ORDERS = ("QUATERNION", "ZYX")
ALIKE = 1e-5


def assert_at(obj: bpy.types.Object, scene_frames: np.ndarray, expected: np.ndarray) -> None:
    shown = shown_worlds([obj], scene_frames)[0]
    error = np.abs(shown - expected).max(axis=(1, 2)) / max(1.0, np.abs(expected).max())
    assert error.max() < ALIKE, f"off by {error.max():.3g} on frame {scene_frames[error.argmax()]}"


def filled(name: str = "Tool", order: str = "QUATERNION", mode: str = "dq_sclerp", seed: int = 0) -> bpy.types.Object:
    obj = key(new_object(name, order), KEYS, seed=seed)
    set_mode(obj, mode)
    return obj


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    ("start", "scale", "repeat", "reverse"),
    [
        *((1, 1.0, 1.0, False), (101, 1.0, 1.0, False), (31, 4.0, 1.0, False), (7, 0.5, 1.0, False)),
        *((11, 1.0, 2.5, False), (-300, 1.7, 3.0, False), (21, 1.0, 1.0, True), (21, 4.0, 2.0, True)),
    ],
)
def test_a_strip_shows_the_in_betweens_of_its_action(live_file, order, start, scale, repeat, reverse):
    obj = filled(order=order)
    eighths = np.arange(0.0, LENGTH * repeat * scale, 0.125)
    place = eighths / scale % LENGTH
    # On seams it is the strip's affair which of both ends it shows.
    inside = np.minimum(place, LENGTH - place) > 1e-3
    expected = expected_bases(obj, KEYS[0] + (LENGTH - place if reverse else place)[inside])
    strip = push_down(obj, start, scale=scale, repeat=repeat, use_reverse=reverse)
    assert_at(obj, start + eighths[inside], expected)
    outside = np.array((strip.frame_start - 5.0, strip.frame_end + 5.0))
    assert_at(obj, outside, shown_worlds([obj], np.array((strip.frame_start, strip.frame_end)))[0])


# -- blending ---------------------------------------------------------------------------------------------------------

How = Callable[[bpy.types.NlaStrip], None]


def animated(*points: tuple[float, float]) -> How:
    def animate(strip: bpy.types.NlaStrip) -> None:
        strip.use_animated_influence = True
        fcurve = strip.fcurves.find("influence")
        fcurve.keyframe_points.clear()
        for point in points:
            fcurve.keyframe_points.insert(*point)

    return animate


def blends(*, into: float = 0.0, out: float = 0.0) -> How:
    def blend(strip: bpy.types.NlaStrip) -> None:
        strip.use_auto_blend = False
        strip.blend_in, strip.blend_out = into, out

    return blend


INFLUENCES: dict[str, How] = {
    "whole": lambda _: None,
    "half": animated((1.0, 0.5)),
    "animated": animated((10.0, 0.2), (45.0, 1.0)),
    "blending in and out": blends(into=20.0, out=15.0),
}
BLENDS = ("REPLACE", "COMBINE", "ADD", "SUBTRACT", "MULTIPLY")


def blended(order: str, blend: str, how: How, *, dense: bool) -> np.ndarray:
    """Where an object is on quarters of frames, with a strip in part over another: with modes, or keyed densely."""
    obj = new_object(f"Tool {dense}", order)
    for seed, mode in enumerate(("cga_slerp", "dq_sclerp")):
        key(obj, KEYS, seed=seed, scale="even")
        set_mode(obj, mode, KEYS)
        if dense:
            key_densely(obj)
        strip = push_down(obj, 1 + 9 * seed, scale=1.0 + seed)
    strip.blend_type = blend
    how(strip)
    bpy.context.view_layer.update()
    assert refresh() == 0
    return shown_worlds([obj], np.arange(1.0, 95.0, 0.25))[0]


@pytest.mark.parametrize(("blend", "order"), in_turn(BLENDS, (*ORDERS, "AXIS_ANGLE")))
@pytest.mark.parametrize("how", INFLUENCES)
def test_a_strip_in_part_shows_what_dense_keys_would(live_file, blend, order, how):
    shown, expected = (blended(order, blend, INFLUENCES[how], dense=dense) for dense in (False, True))
    assert np.abs(shown - expected).max() < 2.0 * ALIKE * max(1.0, np.abs(expected).max())


# -- several strips ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("one_track", [True, False], ids=["one track", "two tracks"])
@pytest.mark.parametrize("modes", [("dq_sclerp", "pga_lerp"), ("dq_sclerp", "BLENDER"), ("BLENDER", "cga_slerp")])
def test_two_strips_each_have_the_mode_that_is_keyed_in_their_action(live_file, modes, one_track):
    obj, actions, expected = new_object(), [], []
    data = obj.animation_data_create()
    for seed, mode in enumerate(modes):
        data.action = None
        set_mode(key(obj, KEYS, seed=seed), mode, KEYS)
        actions.append((data.action, data.action_slot))
        expected.append(expected_bases(obj, ACTION_FRAMES))
    data.action, track = None, data.nla_tracks.new()
    for start, (action, slot) in zip((1, 101), actions, strict=True):
        strip = track.strips.new("Strip", start, action)
        strip.action_slot, strip.extrapolation = slot, "HOLD" if start == 1 else "HOLD_FORWARD"
        track = track if one_track else data.nla_tracks.new()
    bpy.context.view_layer.update()
    assert refresh() == 0
    for start, worlds in zip((1, 101), expected, strict=True):
        assert_at(obj, ACTION_FRAMES + start - 1, worlds)
    assert_at(obj, np.array((60.0, 90.0)), expected[0][[-1, -1]])


def test_an_action_that_is_in_two_strips_and_cycles_moves_as_far_as_either_shows_it(live_file):
    obj = key(new_object(), KEYS, interpolation="LINEAR")
    for fcurve in curves_of(obj).values():
        fcurve.modifiers.new("CYCLES")
    set_mode(obj, "dq_sclerp")
    expected = expected_bases(obj, ACTION_FRAMES)[:-1]
    first = push_down(obj, 1)
    first.action_frame_end = 41.0
    second = new_strip(obj, 201, first.action, first.action_slot, last=121)
    second.extrapolation = "HOLD_FORWARD"
    bpy.context.view_layer.update()
    refresh()
    assert_at(obj, ACTION_FRAMES[:-1], expected)
    for start in (201.0, 241.0, 281.0):
        assert_at(obj, start + np.arange(1.0, 40.0), expected[1:])


# -- edits ------------------------------------------------------------------------------------------------------------


def test_a_mode_is_chosen_for_an_action_that_is_in_a_strip_already(live_file):
    obj = key(new_object(), KEYS)
    action = obj.animation_data.action
    push_down(obj, 101)
    with pytest.raises(ValueError, match=r"Tool.*enter a strip"):
        set_mode(obj, "dq_sclerp", KEYS)
    set_mode(obj, "pga_slerp")
    assert problem_of(obj) == ""
    obj.animation_data.action = action
    expected = expected_bases(obj, ACTION_FRAMES)
    obj.animation_data.action = None
    assert_at(obj, np.arange(101.0, 142.0), expected)


@pytest.mark.parametrize(("start", "scale"), [(101, 1.0), (31, 2.0)])
@pytest.mark.parametrize("influence", [1.0, 0.6])
def test_in_tweak_mode_a_key_inserted_in_between_keeps_the_pose_on_the_screen(live_file, start, scale, influence):
    obj = filled()
    strip = push_down(obj, start, scale=scale)
    strip.influence = influence
    tweak(obj, strip)
    now = np.array((float(start + int(15 * scale)),))
    live_file.scene.frame_set(int(now[0]))
    before = shown_worlds([obj], now)[0]
    for path in ("location", "rotation_quaternion"):
        obj.keyframe_insert(path)
    bpy.context.view_layer.update()
    assert 16.0 in key_frames(obj)
    assert_at(obj, now, before)
