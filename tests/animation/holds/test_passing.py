"""Passing from holder to holder, by an oracle: the motion in each holder depends only on the keys there, and between
them the prop moves smoothly between the places where both would carry it. A key that is inserted does not change that.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import hold_in, refresh, set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.holds.hands import HOLDERS, PROPS, by_an_object, by_fk, free, place, take
from tests.animation.holds.oracle import Held, Motion, apart, carried
from tests.animation.holds.runs import motion_of
from tests.animation.keyed import WIDTHS, Carrier, curve_of, curves_of, rotation_path
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object, push_down
from tests.thoroughness import THOROUGH, combined

MOMENTS = np.arange(0.0, 84.0, 0.625)
"""Frames in steps through all eighths, at which the poses of passes are made, whole frames among them."""

LENGTHS = 0, 1, 3, 4, 10
MODES = "motor_spline", "dq_sclerp", "lerp_slerp", "BLENDER"
RESTING, MOVING = 2e-6, 1e-5
"""Tolerances in metres. While channels move, the error of terms is added."""

PLACES = 6, 15, 18, 26, 37, 42, 43.5, 46, 60, 64.5, 68, 77
"""Frames between keys, after the last key in a holder, and during the pass from there."""

PASSES = (0, 0, 0, 0), (3, 4, 4, 3)
"""Number of frames of each pass: instant, or smooth."""


def keys_of(prop: Carrier, frames: Sequence[float], seed: int, reach: float = 0.1) -> None:
    """Key further random poses of a prop, in its space at that time."""
    for number, frame in enumerate(frames):
        place(prop, 10 * seed + number, reach, frame=frame)


def motions_of(prop: Carrier, holds: Sequence[Held], goes_on: bool = False) -> list[Motion]:
    """Return the motion of a prop in each hold, from the keys there."""
    ends = [*(hold.frame for hold in holds[1:]), np.inf]
    passes = [goes_on, *(hold.frames > 0 for hold in holds[1:]), goes_on]
    return [
        motion_of(prop, -np.inf if number == 0 else hold.frame, end, comes=passes[number], goes=passes[number + 1])
        for number, (hold, end) in enumerate(zip(holds, ends, strict=True))
    ]


def off(
    prop: Carrier, twin: Carrier, holds: Sequence[Held], frames: np.ndarray = MOMENTS, goes_on: bool = False
) -> float:
    """Return the largest distance from the expected place, in metres."""
    expected = carried(twin, holds, motions_of(prop, holds, goes_on), frames)
    (seen,) = shown_worlds([prop], frames)
    return apart(seen, expected)


def juggled(prop: Carrier, holders: Sequence[Carrier], frames: Sequence[int], *, moves: bool) -> list[Held]:
    """Have a prop picked up, passed on, let go, and held once more."""
    keys_of(prop, (1, 11) if moves else (1,), 1, 0.5)
    holds = [Held(1, None)]
    for at, holder, over in zip((20, 44, 66, 75), (*holders, None, holders[0]), frames, strict=True):
        take(prop, holder, at, frames=over, seed=at)
        holds.append(Held(at, holder, over))
        if moves:
            keys_of(prop, (at + 4, at + 8), at)
    return holds


def thrown(frames: Sequence[int] = PASSES[1], order: str = "QUATERNION") -> tuple[Carrier, Carrier, list[Held]]:
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


@pytest.mark.parametrize(("length", "mode"), in_turn(LENGTHS, MODES))
def test_a_pass_is_the_formula(live_file, length, mode):
    for moves in (False, True) if THOROUGH else (length % 2 == MODES.index(mode) % 2,):
        prop, twin = free(("QUATERNION", "XYZ", "AXIS_ANGLE")[length % 3])
        holders = by_fk("First", 11), by_an_object("Second", 31)
        holds = juggled(prop, holders, 4 * (length,), moves=moves)
        set_mode(prop, mode)
        assert off(prop, twin, holds) < (MOVING if moves else RESTING)


@pytest.mark.parametrize(("by", "what"), combined([*HOLDERS], [*PROPS]))
def test_all_things_rest_in_all_hands_and_pass_between_them(live_file, by, what):
    prop, twin = PROPS[what]()
    holders = HOLDERS[by]("First", 11), HOLDERS[by]("Second", 31)
    holds = juggled(prop, holders, (3, 4, 10, 3), moves=False)
    moved = [np.ptp(worlds[:, :3, 3], axis=0).max() for worlds in shown_worlds(holders, MOMENTS[::8])]
    assert min(moved) > 0.05, "the hands move, or this test says nothing"
    # A bone that inherits its location differently from its rotation has no space of its own in the world.
    in_hands = (MOMENTS >= 20.0) & (MOMENTS < 56.0)
    frames = MOMENTS[in_hands] if "without" in what else MOMENTS
    assert off(prop, twin, holds, frames) < RESTING


def test_a_hand_near_gimbal_lock_holds_as_well(live_file):
    """Blender's own Child Of uses Euler angles if it leaves out scale, which causes an error of 0.3 mm here."""
    hand, tool = new_object("Hand"), new_object("Tool")
    frames = np.arange(1.0, 121.0)
    turns = [
        Euler((0.5 + 0.005 * frame, np.pi / 2 - 2e-4 * (1.0 + 0.3 * np.sin(frame)), 0.3)).to_quaternion()
        for frame in frames
    ]
    write_channel(hand, "rotation_quaternion", frames, np.array(turns))
    hand.location = 0.5, 0.4, 1.2
    hold_in(tool, hand)
    place(tool, 3, 0.1, frame=1)
    held, moved = shown_worlds([hand, tool], frames)
    assert apart(moved, held @ np.linalg.inv(held[0]) @ moved[0]) < RESTING


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_all_modes_move_in_hands_as_they_do_in_the_world(live_file, mode):
    prop, twin = free("YXZ")
    holds = juggled(prop, (by_fk("First", 11), by_an_object("Second", 31)), (0, 4, 0, 3), moves=True)
    set_mode(prop, mode)
    assert off(prop, twin, holds) < MOVING


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
    # A channel without keys in a hold rests there.
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
    assert apart(before, after) < RESTING


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


@pytest.mark.parametrize(
    ("over", "near", "tolerance"),
    [
        (0, (-0.01, -0.001, 0.001, 0.01), MOVING),
        # Between eighths of frames, the poses near the end of a pass are interpolated linearly.
        (4, (-0.05, -0.01, -0.001, 0.001, 0.01, 0.02, 0.05), 5e-5),
    ],
)
def test_blur_around_a_switch_has_no_pop(live_file, over, near, tolerance):
    prop, twin, holds = thrown(4 * (over,))
    moments = np.add.outer((20.0, 44.0, 66.0), near).ravel()
    assert off(prop, twin, holds, moments) < tolerance


def calm(prop: Carrier) -> None:
    """Reduce rotations between keys so that extrapolation never gets half a turn away from the start."""
    curves = [curve_of(prop, "rotation_quaternion", index) for index in range(4)]
    values = 0.15 * np.array([[key.co.y for key in curve.keyframe_points] for curve in curves])
    values += np.array((1.0, 0.3, 0.2, -0.1))[:, None]
    for curve, row in zip(curves, values / np.linalg.norm(values, axis=0), strict=True):
        for key, value in zip(curve.keyframe_points, row, strict=True):
            key.co_ui.y = value
    edited(prop)


def with_key(prop: Carrier, at: float, index: int = -1) -> float:
    """Insert a key of location and rotation, and return how far the object moved at most."""
    (before,) = shown_worlds([prop], MOMENTS)
    bpy.context.scene.frame_set(int(at), subframe=at % 1)
    for path in ("location", rotation_path(prop)) if index < 0 else ("location",):
        prop.keyframe_insert(path, index=index, frame=at)
    bpy.context.view_layer.update()
    (after,) = shown_worlds([prop], MOMENTS)
    return apart(before, after)


@pytest.mark.parametrize(("at", "frames"), in_turn(PLACES, PASSES))
def test_what_rests_in_hands_rests_on(live_file, frames, at):
    prop, _ = free()
    juggled(prop, (by_fk("First", 11), by_an_object("Second", 31)), frames, moves=False)
    assert with_key(prop, at) < RESTING


@pytest.mark.parametrize(("at", "move"), in_turn(PLACES, list(product(MODES, PASSES))))
def test_what_moves_in_hands_moves_on(live_file, at, move):
    mode, frames = move
    prop, _, _ = thrown(frames)
    calm(prop)
    set_mode(prop, mode)
    assert with_key(prop, at) < MOVING
    assert with_key(prop, at + 1.25) < MOVING


@pytest.mark.parametrize("mode", MODES)
def test_a_key_of_a_single_component_does_no_more(live_file, mode):
    prop, _, _ = thrown()
    calm(prop)
    set_mode(prop, mode)
    assert with_key(prop, 26, index=1) < MOVING
    assert with_key(prop, 60, index=0) < MOVING


def test_a_key_at_rest_that_is_moved_is_hit(live_file):
    prop, _, _ = thrown(PASSES[0])
    calm(prop)
    assert with_key(prop, 60) < MOVING
    bpy.context.scene.frame_set(60)
    prop.location.x += 0.1
    posed = np.array(prop.location)
    prop.keyframe_insert("location", frame=60)
    for frame in (10, 60):
        bpy.context.scene.frame_set(frame)
    assert np.abs(np.array(prop.location) - posed).max() < RESTING
