"""Cycles: in each round the body moves as if its keys were real ones, and what is used up is Blender's own again.

With an offset that is so for what ends as it begins, but for its location, or turns about one axis.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, problem_of, repeat, set_mode, write_channel
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, rotation_path, snapshot
from tests.animation.oracle import expected_bases, matrices, shown_worlds
from tests.animation.scenes import key, new_object, random_values

CYCLES = ("NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR")
FRAMES = (31.0, 35.0, 42.0)

AROUND = np.arange(0.0, 76.0, 0.25)
"""The frames of the scene, and quarters: more than two rounds on both sides."""


def keyed(order: str, interpolation: str = "LINEAR") -> bpy.types.Object:
    """An object with three keys, turned on the last as on the first."""
    obj = new_object("Tool", order)
    for path in ("location", rotation_path(obj)):
        values = random_values(obj, path, 3)
        if path != "location":
            values[2] = values[0]
        write_channel(obj, path, np.array(FRAMES), values, interpolation=interpolation)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 75
    return obj


def cyclic(order: str, interpolation: str = "LINEAR", **settings: object) -> bpy.types.Object:
    obj = keyed(order, interpolation)
    for fcurve in curves_of(obj).values():
        cycles = fcurve.modifiers.new("CYCLES")
        for name, value in settings.items():
            setattr(cycles, name, value)
        fcurve.update()
    return obj


def unrolled(obj: bpy.types.Object, before: str, after: str, before_count: int, after_count: int) -> np.ndarray:
    """Where a cyclic object has to be on the frames around: in each round as if the round's keys were real ones.

    On the seams, and where the rounds are used up, there is nothing but Blender's own.
    """
    first, last = key_frames(obj)[[0, -1]]
    result = expected_bases(obj, AROUND, keys=np.empty(0))
    for number in range(-4, 5):
        kind, count = (after, after_count) if number > 0 else (before, before_count)
        if number and (kind == "NONE" or (count and abs(number) > count)):
            continue
        since = AROUND - first - number * (last - first)
        inside = (since > 0.0) & (since < last - first)
        if not inside.any():
            continue
        spare = one_round(obj, kind if number else "NONE", number)
        result[inside] = expected_bases(spare, AROUND[inside])
        discard(spare)
    return result


def discard(spare: bpy.types.Object) -> None:
    bpy.data.actions.remove(spare.animation_data.action)
    bpy.data.objects.remove(spare)


def one_round(obj: bpy.types.Object, kind: str, number: int) -> bpy.types.Object:
    """A copy out of the scene, with the keys of one round. Mirrored ones need straight lines between keys."""
    first, last = key_frames(obj)[[0, -1]]
    spare = obj.copy()
    spare.animation_data.action = obj.animation_data.action.copy()
    for fcurve in curves_of(spare).values():
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
        points = fcurve.keyframe_points
        rise = number * (points[-1].co.y - points[0].co.y) if kind == "REPEAT_OFFSET" else 0.0
        values = [point.co.y for point in points]
        times = [point.co.x for point in points]
        if kind == "MIRROR" and number % 2:
            values.reverse()
            times = [first + last - time for time in reversed(times)]
        for point, time, value in zip(points, times, values, strict=True):
            shift = time + number * (last - first) - point.co.x, value + rise - point.co.y
            for part in ("co", "handle_left", "handle_right"):
                setattr(point, part, [a + b for a, b in zip(getattr(point, part), shift, strict=True)])
    return spare


def assert_unrolled(obj: bpy.types.Object, *cycles: object) -> None:
    shown, expected = shown_worlds([obj], AROUND)[0], unrolled(obj, *cycles)
    error = np.abs(shown - expected).max(axis=(1, 2)) / np.abs(expected).max()
    assert error.max() < 1e-5, f"off by {error.max():.3g} on frame {AROUND[error.argmax()]}"


@pytest.mark.parametrize(("sides", "count"), in_turn(itertools.product(CYCLES, repeat=2), [0, 1, 2]))
def test_cycles_repeat_the_rigid_motion_on_both_sides(live_file, sides, count):
    before, after = sides
    obj = cyclic("QUATERNION", mode_before=before, mode_after=after, cycles_before=count, cycles_after=count)
    keys = snapshot(obj)
    set_mode(obj, "dq_sclerp")
    assert snapshot(obj) == keys
    assert_unrolled(obj, before, after, count, count)


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ("QUATERNION", "YZX", "AXIS_ANGLE")))
@pytest.mark.parametrize("kind", CYCLES[1:3])
def test_cycles_repeat_every_mode_with_the_easing_of_its_keys(live_file, mode, kind, order):
    obj = cyclic(order, "BEZIER" if kind == "REPEAT" else "SINE", mode_before=kind, mode_after=kind)
    set_mode(obj, mode)
    if kind == "REPEAT" or not KEYFRAME_MODES[mode].is_smooth:
        assert_unrolled(obj, kind, kind, 0, 0)


@pytest.mark.parametrize("kind", ["REPEAT_OFFSET", "MIRROR"])
def test_a_smooth_mode_flows_on_from_round_to_round(live_file, kind):
    obj = cyclic("QUATERNION", mode_before=kind, mode_after=kind)
    set_mode(obj, "motor_spline")
    shown = shown_worlds([obj], AROUND)[0]
    times, values = [], []
    for number in range(-4, 6):
        spare = one_round(obj, kind, number)
        curves = curves_of(spare)
        channels = [curves["location", index] for index in range(3)]
        channels += [curves["rotation_quaternion", index] for index in range(4)]
        times += key_frames(spare)[:-1].tolist()
        values += [[fcurve.evaluate(frame) for fcurve in channels] for frame in key_frames(spare)[:-1]]
        discard(spare)
    positions, quaternions = np.split(np.array(values), (3,), axis=1)
    expected = interpolate(times, Poses(positions, quaternions), AROUND, "motor_spline")
    placed = matrices(expected.positions, expected.quaternions, np.ones((len(AROUND), 3)))
    assert np.abs(shown - placed).max() < 1e-5 * np.abs(placed).max()


def test_a_wheel_rolls_on(live_file):
    obj = new_object("Wheel", "XYZ")
    write_channel(obj, "location", np.array(FRAMES), [(0, 0, 0), (1, 0, 0.1), (3, 0, 0)])
    write_channel(obj, "rotation_euler", np.array(FRAMES), [(0.3, 0, 0), (1.3, 0, 0), (3.3, 0, 0)])
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 75
    set_mode(obj, "dq_sclerp")
    repeat(obj, "REPEAT_OFFSET")
    assert problem_of(obj) == ""
    assert_unrolled(obj, "REPEAT_OFFSET", "REPEAT_OFFSET", 0, 0)


@pytest.mark.parametrize("kind", ["REPEAT", "MIRROR"])
def test_cycles_come_in_front_of_what_there_is(live_file, kind):
    obj = keyed("QUATERNION")
    set_mode(obj, "dq_sclerp")
    repeat(obj, kind)
    assert {fcurve.modifiers[0].type for fcurve in curves_of(obj).values()} == {"CYCLES"}
    assert_unrolled(obj, kind, kind, 0, 0)
    repeat(obj, kind)
    assert_unrolled(obj, kind, kind, 0, 0)


def test_what_does_not_go_round_together_is_refused_with_the_way_out(live_file):
    obj = cyclic("QUATERNION")
    curves_of(obj)["location", 1].modifiers[0].mute = True
    with pytest.raises(Refused, match=r"Tool repeats, but not all of it together.*Add Cycles"):
        set_mode(obj, "dq_sclerp")
    repeat(obj)
    set_mode(obj, "dq_sclerp")
    assert_unrolled(obj, "REPEAT", "REPEAT", 0, 0)
    turned = key(new_object("Turned"), FRAMES)
    set_mode(turned, "dq_sclerp")
    with pytest.raises(Refused, match=r"Turned ends turned or scaled otherwise.*choose Repeat"):
        repeat(turned, "REPEAT_OFFSET")
    for fcurve in curves_of(turned).values():
        for term in list(fcurve.modifiers):
            fcurve.modifiers.remove(term)
        cycles = fcurve.modifiers.new("CYCLES")
        cycles.mode_before = cycles.mode_after = "REPEAT_OFFSET"
    bpy.context.view_layer.update()
    assert problem_of(turned).startswith("Turned ends turned or scaled otherwise")
