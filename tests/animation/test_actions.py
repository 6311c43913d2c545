"""Actions: after everyday edits (unlink, share, reuse, delete) objects keep nothing stale, and in NLA strips at any
place, scale, repetition and blending they show Blender's result for channels that have the motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, modes_of, problem_of, refresh, set_mode
from tests.animation.bones.poses import expected_poses, shown_of
from tests.animation.bones.rigs import ORDERS, in_turn, key_all, new_rig
from tests.animation.keyed import Carrier, curves_of
from tests.animation.oracle import assert_near, assert_shown, expected_bases, shown_worlds
from tests.animation.scenes import FRAMES, key, key_densely, new_object, new_strip, push_down, tweak

PLAYED = np.arange(-2.0, 44.0)


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_linear_extrapolation_goes_on_to_where_a_scene_ends_that_was_made_anew(live_file, kind):
    obj = key(new_object(), (5.0, 11.0, 30.0), interpolation="LINEAR")
    action = obj.animation_data.action
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 45
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    set_mode(obj, "dq_sclerp")
    assert tuple(action.frame_range) == (5.0, 30.0), "an Action that goes on is no longer for it"
    assert_shown([obj], np.arange(46.0))
    bpy.ops.scene.new(type=kind)
    bpy.context.view_layer.update()
    bpy.context.scene.frame_end = 70
    bpy.context.view_layer.update()
    assert_shown(bpy.context.scene.objects, np.arange(71.0))


def test_a_mode_that_was_chosen_before_there_were_keys_waits_for_them(live_file):
    obj = new_object()
    obj.rigid_motion.mode = "pga_lerp"
    set_mode(other := new_object("Other"), "cga_lerp")
    for waiting, mode in ((obj, "pga_lerp"), (other, "cga_lerp")):
        key(waiting)
        bpy.context.view_layer.update()
        assert modes_of(waiting, np.array(FRAMES[:1])) == [mode]
        assert_shown([waiting], PLAYED)
        waiting.animation_data.action = None
        bpy.context.view_layer.update()
        key(waiting, seed=3)
        bpy.context.view_layer.update()
        assert modes_of(waiting, np.array(FRAMES[:1])) == ["BLENDER"], "it was for the first Action"


def test_what_is_deleted_with_an_edit_of_it_still_to_be_seen_is_asked_for_nothing_more(live_file):
    for number in range(30):
        obj = key(new_object(f"Tool {number}"), seed=number)
        set_mode(obj, "dq_sclerp")
        obj.location.x += 1.0
        bpy.data.objects.remove(obj)
        if number % 2:
            live_file.scene.frame_set(number)
        else:
            bpy.context.view_layer.update()
    assert not live_file.scene.objects


@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_lerp", "motor_spline"])
def test_two_keys_on_one_frame_leave_a_mode_to_the_object(live_file, mode):
    """Shift D does this, until the keys are moved apart."""
    obj = key(new_object("Tool", "QUATERNION"), interpolation="LINEAR")
    set_mode(obj, mode)
    (before,) = shown_worlds([obj], PLAYED)
    for fcurve in curves_of(obj).values():
        if fcurve.keyframe_points:
            keys = fcurve.keyframe_points
            keys.add(1)
            keys[-1].co, keys[-1].interpolation = keys[1].co, "LINEAR"
            keys.sort()
            fcurve.update()
    bpy.context.view_layer.update()
    assert problem_of(obj) == ""
    assert key_frames(obj).tolist() == [1.0, 11.0, 24.0, 40.0]
    np.testing.assert_allclose(shown_worlds([obj], PLAYED)[0], before, atol=1e-5)


# In strips

KEYS = (1.0, 11.0, 21.0, 41.0)
LENGTH = KEYS[-1] - KEYS[0]
ACTION_FRAMES = np.append(np.arange(KEYS[0], KEYS[-1], 0.375), KEYS[-1])
KINDS = ("object", "rig")


def new(kind: str, order: str = "QUATERNION") -> bpy.types.Object:
    return new_object("Tool", order) if kind == "object" else new_rig("Tool", rotation_mode=order)


def carriers_of(obj: bpy.types.Object) -> list[Carrier]:
    return list(obj.pose.bones) if obj.pose else [obj]


def key_anew(obj: bpy.types.Object, mode: str = "dq_sclerp", seed: int = 0, **how: str) -> bpy.types.Object:
    """Key the object or its bones, in this mode."""
    (key_all if obj.pose else key)(obj, frames=KEYS, seed=seed, **how)
    set_mode(carriers_of(obj), mode, KEYS)
    return obj


def expected_of(obj: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    """Return its expected matrices, or those of its bones in armature space, shape (k, m, 4, 4)."""
    return np.stack([*expected_poses(obj, frames).values()]) if obj.pose else expected_bases(obj, frames)[None]


PLACES = [
    *((1, 1.0, 1.0, False), (101, 1.0, 1.0, False), (31, 4.0, 1.0, False), (7, 0.5, 1.0, False)),
    *((-57, 1.0, 1.0, False), (11, 1.0, 2.5, False), (11, 2.0, 3.0, False), (-300, 3.0, 3.0, False)),
    *((21, 1.0, 1.0, True), (21, 0.5, 2.0, True), (21, 4.0, 2.0, True)),
]
"""A strip's start, scale, number of repetitions, and whether it runs backwards."""


def animate(strip: bpy.types.NlaStrip, *points: tuple[float, float]) -> None:
    """Key the strip's influence, on frames since its start."""
    strip.use_animated_influence = True
    fcurve = strip.fcurves.find("influence")
    fcurve.keyframe_points.clear()
    for since, influence in points:
        fcurve.keyframe_points.insert(strip.frame_start + since, influence)


def blend_in_and_out(strip: bpy.types.NlaStrip) -> None:
    strip.use_auto_blend = False
    strip.blend_in, strip.blend_out = 10.0, 7.0


INFLUENCES: dict[str, Callable[[bpy.types.NlaStrip], None]] = {
    "whole": lambda _: None,
    "half": lambda strip: animate(strip, (0.0, 0.5)),
    "animated": lambda strip: animate(strip, (0.0, 0.2), (35.0, 1.0)),
    "blending in and out": blend_in_and_out,
}
BLENDS = ("REPLACE", "COMBINE", "ADD", "SUBTRACT", "MULTIPLY")


@pytest.mark.parametrize(
    ("place", "case"),
    in_turn(
        zip(PLACES, itertools.cycle(ORDERS), strict=False),
        [*zip(itertools.cycle(KINDS), itertools.cycle(INFLUENCES), BLENDS, strict=False)],
    ),
)
def test_a_strip_over_another_shows_what_dense_keys_would(live_file, place, case):
    (kind, how, blend), ((start, scale, repeat, reverse), order) = case, place
    # Steps of three eighths of a frame visit all eighths, also before and after the strip.
    frames = start + np.arange(-9.0, LENGTH * repeat * scale + 9.0, 0.375 * max(scale, 1.0))
    shown = []
    for dense in (False, True):
        obj = new(kind, order)
        for seed, mode in enumerate(("cga_slerp", "dq_sclerp")):
            key_anew(obj, mode, seed, scale="even")
            for carrier in carriers_of(obj) if dense else ():
                key_densely(carrier)
            assert dense != any(len(fcurve.modifiers) for fcurve in curves_of(obj).values())
            strip = push_down(obj)
        strip.frame_start_ui, strip.scale, strip.repeat, strip.use_reverse = start, scale, repeat, reverse
        strip.blend_type = blend
        INFLUENCES[how](strip)
        bpy.context.view_layer.update()
        assert refresh() == 0
        shown.append(shown_of(obj, frames))
    assert np.ptp(shown[0], axis=1).max() > 0.1
    assert_near(*shown)


def test_an_action_that_is_in_two_strips_and_cycles_moves_as_far_as_either_shows_it(live_file):
    obj = key(new_object(), KEYS, interpolation="LINEAR")
    for fcurve in curves_of(obj).values():
        fcurve.modifiers.new("CYCLES")
    set_mode(obj, "dq_sclerp")
    frames = np.arange(1.0, LENGTH)
    expected = expected_of(obj, KEYS[0] + frames)
    first = push_down(obj)
    first.action_frame_end = 41.0
    second = new_strip(obj, 201, first.action, first.action_slot, last=121)
    second.extrapolation = "HOLD_FORWARD"
    bpy.context.view_layer.update()
    refresh()
    for start in (1.0, 201.0, 241.0, 281.0):
        assert_near(shown_of(obj, start + frames), expected)


@pytest.mark.parametrize("kind", KINDS)
def test_a_mode_is_chosen_for_an_action_that_is_in_a_strip_already(live_file, kind):
    obj = key_anew(new(kind), "BLENDER")
    action, carriers = obj.animation_data.action, carriers_of(obj)
    push_down(obj, 101)
    with pytest.raises(ValueError, match=r"^Tool.*enter a strip"):
        set_mode(carriers, "dq_sclerp", KEYS)
    set_mode(carriers, "pga_slerp")
    assert {problem_of(carrier) for carrier in carriers} == {""}
    obj.animation_data.action = action
    expected = expected_of(obj, ACTION_FRAMES)
    obj.animation_data.action = None
    assert_near(shown_of(obj, 100.0 + ACTION_FRAMES), expected)


@pytest.mark.parametrize(("start", "scale"), [(101, 1.0), (31, 2.0)])
@pytest.mark.parametrize("influence", [1.0, 0.6])
@pytest.mark.parametrize("kind", KINDS)
def test_in_tweak_mode_a_key_inserted_in_between_keeps_the_pose_on_the_screen(live_file, kind, start, scale, influence):
    obj = key_anew(new(kind))
    strip = push_down(obj, start, scale=scale)
    animate(strip, (0.0, influence))
    tweak(obj, strip)
    now = np.array((start + 15.0 * scale,))
    live_file.scene.frame_set(int(now[0]))
    before = shown_of(obj, now)
    for carrier in carriers_of(obj):
        carrier.keyframe_insert("location")
        carrier.keyframe_insert("rotation_quaternion")
        bpy.context.view_layer.update()
        assert 16.0 in key_frames(carrier)
    assert_near(shown_of(obj, now), before)
