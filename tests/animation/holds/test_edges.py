"""Edge cases of keys of held objects: the motion in each holder depends only on the keys there."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode, set_turns
from tests.animation.holds.hands import by_an_object, by_fk, free, place, take
from tests.animation.holds.oracle import Carrier, Held, apart, carried
from tests.animation.holds.test_passing import MOVING, RESTING, juggled, keys_of, motions_of, off
from tests.animation.keyed import WIDTHS, curve_of, curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import push_down

KEPT = 2e-6
"""Tolerance in metres for edits that must not move the prop."""


def thrown(frames: tuple[int, ...] = (3, 4, 4, 3), order: str = "QUATERNION") -> tuple[Carrier, Carrier, list[Held]]:
    prop, twin = free(order)
    return prop, twin, juggled(prop, (by_fk("First", 11), by_an_object("Second", 31)), frames, moves=True)


def keys_on(prop: Carrier, frame: float) -> list[bpy.types.Keyframe]:
    return [
        key
        for (path, _), curve in curves_of(prop).items()
        if path in WIDTHS
        for key in curve.keyframe_points
        if abs(key.co.x - frame) < 0.005
    ]


def edited(prop: Carrier) -> None:
    """Let Blender and the extension see an edit by script."""
    for curve in curves_of(prop).values():
        curve.update()
    bpy.context.view_layer.update()
    refresh()
    bpy.context.view_layer.update()


def test_passes_that_are_closer_than_they_are_long_follow_one_another(live_file):
    prop, twin = free()
    first, second, third = by_fk("First", 11), by_an_object("Second", 31), by_an_object("Third", 51)
    keys_of(prop, (1, 11), 1)
    holds = [Held(1, None)]
    for at, holder, over in ((30, first, 4), (34, second, 10), (36, third, 4), (37, first, 4), (40, second, 3)):
        take(prop, holder, at, frames=over, seed=at)
        holds.append(Held(at, holder, over))
    assert off(prop, twin, holds) < RESTING


def test_a_pass_begins_at_the_first_key_at_the_earliest(live_file):
    prop, twin = free("XYZ")
    hand = by_fk("First", 11)
    place(prop, 5, frame=28)
    take(prop, hand, 30, frames=10)
    assert off(prop, twin, [Held(28, None), Held(30, hand, 10)]) < RESTING


@pytest.mark.parametrize("interpolation", ["CONSTANT", "LINEAR", "ELASTIC", "SINE"])
def test_eases_before_a_switch_end_in_their_own_holder(live_file, interpolation):
    prop, twin, holds = thrown((0, 4, 0, 3) if interpolation == "CONSTANT" else (3, 4, 0, 3))
    for curve in curves_of(prop).values():
        if curve.data_path in WIDTHS:
            for key in curve.keyframe_points:
                key.interpolation = interpolation
    edited(prop)
    assert off(prop, twin, holds) < MOVING


@pytest.mark.parametrize("mode", ["motor_spline", "dq_sclerp", "BLENDER"])
def test_keys_of_single_components_and_parts_are_keys_of_the_hold(live_file, mode):
    prop, twin, holds = thrown(order="XYZ")
    prop.location.x = 0.07
    prop.keyframe_insert("location", index=0, frame=26)
    prop.rotation_euler.z = 0.6
    prop.keyframe_insert("rotation_euler", index=2, frame=49.0)
    prop.location = 0.02, 0.05, -0.03
    prop.keyframe_insert("location", frame=58)
    bpy.context.view_layer.update()
    set_mode(prop, mode)
    assert off(prop, twin, holds) < MOVING


def test_a_channel_without_keys_in_a_hold_rests_there(live_file):
    prop, twin, holds = thrown(order="XYZ")
    for index in (0, 2):
        points = curve_of(prop, "location", index).keyframe_points
        for key in [key for key in points if 43 < key.co.x < 60][::-1]:
            points.remove(key)
    edited(prop)
    assert off(prop, twin, holds) < MOVING


def test_breakdowns_and_turns_go_on_in_a_hand(live_file):
    prop, twin, holds = thrown()
    for key in keys_on(prop, 24) + keys_on(prop, 48):
        key.type = "BREAKDOWN"
    edited(prop)
    assert off(prop, twin, holds) < MOVING
    for key in keys_on(prop, 24) + keys_on(prop, 48):
        key.type = "KEYFRAME"
    set_turns(prop, 1, [20.0, 48.0])
    assert off(prop, twin, holds) < MOVING


@pytest.mark.parametrize("mode", ["motor_spline", "dq_sclerp", "BLENDER"])
def test_the_motion_in_one_hand_has_nothing_of_the_numbers_in_the_next(live_file, mode):
    prop, _, _ = thrown((0, 4, 0, 3))
    set_mode(prop, mode)
    frames = np.arange(20.0, 40.0, 0.25)
    (before,) = shown_worlds([prop], frames)
    for key in keys_on(prop, 44) + keys_on(prop, 66):
        key.co_ui.y += 0.7
    edited(prop)
    (after,) = shown_worlds([prop], frames)
    assert apart(before, after) < KEPT


def test_what_goes_on_at_its_slope_does_so_in_its_own_holder(live_file):
    prop, twin, holds = thrown()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 95
    for curve in curves_of(prop).values():
        if curve.data_path in WIDTHS:
            curve.extrapolation = "LINEAR"
    edited(prop)
    assert off(prop, twin, holds, np.arange(0.0, 95.0, 0.25), goes_on=True) < MOVING


@pytest.mark.parametrize("scale", [1.0, 1.7])
@pytest.mark.parametrize("over", [(3, 4, 4, 3), (0, 0, 0, 0)])
def test_what_is_held_in_a_strip_is_held_and_passed_on_its_frames(live_file, scale, over):
    prop, twin, holds = thrown(over)
    motions = motions_of(prop, holds)
    push_down(prop, scale=scale)

    def in_scene(frames: np.ndarray) -> np.ndarray:
        return 1.0 + scale * (frames - 1.0)

    # In the scene, everything is stretched by the scale.
    held = [hold._replace(frame=in_scene(hold.frame), frames=scale * hold.frames) for hold in holds]
    slow = [lambda at, motion=motion: motion(1.0 + (at - 1.0) / scale) for motion in motions]
    frames = in_scene(np.arange(1.0, 82.0, 0.25))
    (seen,) = shown_worlds([prop], frames)
    assert apart(seen, carried(twin, held, slow, frames, soon=scale / 64.0)) < MOVING


def test_blur_just_before_a_switch_is_of_the_old_hand(live_file):
    prop, twin, holds = thrown((0, 0, 0, 0))
    near = np.array([frame - before for frame in (20.0, 44.0, 66.0, 75.0) for before in (0.01, 0.001, -0.001, -0.01)])
    assert off(prop, twin, holds, near) < MOVING


def test_blur_around_the_end_of_a_pass_has_no_pop(live_file):
    prop, twin, holds = thrown((4, 4, 4, 4))
    near = np.concatenate([frame + np.array([-0.05, -0.01, -0.001, 0.001, 0.01, 0.02, 0.05]) for frame in (20, 44, 66)])
    # Between eighths of frames, the poses near the end of a pass are interpolated linearly.
    assert off(prop, twin, holds, near) < 5e-5
