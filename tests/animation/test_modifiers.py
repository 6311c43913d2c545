"""F-curve modifiers added by the animator act on the displayed motion, of any type and added at any time.

The reference is Blender itself: the same modifiers on an object with linear keys on every eighth of a frame. With
Cycles, the body moves in each round as if its keys were real, and after the last round as in Blender's own mode; with
Repeat with Offset, this requires equal rotation and scale at both ends, or turns about one axis.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, problem_of, refresh, repeat, set_mode, set_turns, write_channel
from rigid_motion.animation.actions.modifiers import add_cycles, set_settings
from rigid_motion.animation.fcurves.keys import Cycles
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, rotation_path, snapshot
from tests.animation.oracle import assert_near, expected_bases, shown_worlds
from tests.animation.scenes import give_own_deltas, key, key_densely, new_object, random_values
from tests.motion.bodies import matrices

PLAYED, IN_ROUNDS = np.arange(1.0, 40.0, 0.25), np.arange(-60.0, 120.0, 0.5)
RANGE = {"use_restricted_range": True, "frame_start": 7.0, "frame_end": 31.0, "blend_in": 5.0}
PART = {"use_influence": True, "influence": 0.5}

MODIFIERS: dict[str, tuple[str, dict[str, object]]] = {
    "twos": ("STEPPED", {"frame_step": 2.0, "frame_offset": 1.0}),
    "twos and a half, for a while": ("STEPPED", {"frame_step": 2.5, "use_frame_start": True, "frame_start": 9.0}),
    "stepped in part": ("STEPPED", {"frame_step": 3.0, **PART}),
    "noise": ("NOISE", {"strength": 1.5, "scale": 4.0, "phase": 3.0}),
    "noise in part of the time": ("NOISE", {"strength": 1.5, "scale": 4.0, **RANGE}),
    "noise that multiplies": ("NOISE", {"strength": 1.5, "scale": 4.0, "blend_type": "MULTIPLY", **PART}),
    "limits": ("LIMITS", {"use_min_y": True, "min_y": -0.4, "use_max_y": True, "max_y": 0.3}),
    "sine": ("FNGENERATOR", {"use_additive": True, "amplitude": 0.7, "phase_multiplier": 0.4}),
    "sine instead": ("FNGENERATOR", {"amplitude": 0.7, "phase_multiplier": 0.4, **PART}),
    "ramp": ("GENERATOR", {"use_additive": True, "coefficients": (0.5, -0.02), **RANGE}),
    "ramp of factors": ("GENERATOR", {"use_additive": True, "mode": "POLYNOMIAL_FACTORISED"}),
    "muted": ("LIMITS", {"use_min_y": True, "min_y": 5.0, "mute": True}),
}


def modify(fcurves, *modifiers: tuple[str, dict[str, object]]) -> None:
    for fcurve, (kind, settings) in itertools.product(fcurves, modifiers):
        set_settings(fcurve.modifiers.new(kind), settings)
    bpy.context.view_layer.update()


def some_of(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Return the channels that get modifiers: only some channels of each part."""
    curves = curves_of(obj)
    return [curves["location", 1], curves["location", 2], curves[rotation_path(obj), 1], curves["scale", 0]]


@pytest.mark.parametrize(
    ("what", "how"),
    in_turn(
        [*MODIFIERS, "twos, then noise"],
        [
            ("QUATERNION", "after the mode"),
            ("ZXY", "before the mode"),
            ("AXIS_ANGLE", "after the mode"),
            ("QUATERNION", "before the mode, in rounds"),
        ],
    ),
)
def test_a_modifier_acts_on_what_is_seen(live_file, what, how):
    order, when = how
    obj, dense = (key(new_object(name, order), seed=4, scale="even") for name in ("Tool", "Dense"))
    for moved in (obj, dense):
        give_own_deltas(moved)
    keys, in_rounds = snapshot(obj), when.endswith("rounds")
    modifiers = [MODIFIERS[name] for name in what.split(", then ")]
    set_mode(dense, "cga_slerp")
    key_densely(dense)
    for moved in (obj, dense):
        if moved is dense or when != "after the mode":
            modify(some_of(moved), *modifiers)
        if in_rounds:
            repeat(moved, "MIRROR")
    set_mode(obj, "cga_slerp")
    if when == "after the mode":
        modify(some_of(obj), *modifiers)
    assert problem_of(obj) == ""
    assert refresh() == 0
    shown, expected = shown_worlds([obj, dense], IN_ROUNDS if in_rounds else PLAYED)
    assert_near(shown, expected, what, 2e-5)
    set_mode(obj, "BLENDER")
    for fcurve in some_of(obj):
        for kept, (kind, settings) in zip(list(fcurve.modifiers)[in_rounds:], modifiers, strict=True):
            assert kept.type == kind
            for name, value in settings.items():
                got = getattr(kept, name)
                assert (tuple(got) if name == "coefficients" else got) == pytest.approx(value), name
    for fcurve in curves_of(obj).values():
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
    assert snapshot(obj) == keys


@pytest.mark.parametrize("step", [3.0, 40.0])
def test_stepped_looks_at_frames_that_are_not_seen(live_file, step):
    """Before the first frame of a scene, and after its last frame; also with steps longer than planned at first."""
    obj, dense = (key(new_object(name), seed=4) for name in ("Tool", "Dense"))
    live_file.scene.frame_start, live_file.scene.frame_end = 1, 40
    for fcurve in [*curves_of(obj).values(), *curves_of(dense).values()]:
        fcurve.extrapolation = "LINEAR"
    set_mode([obj, dense], "dq_sclerp")
    live_file.scene.frame_start, live_file.scene.frame_end = -100, 141
    bpy.context.view_layer.update()
    (long,) = shown_worlds([dense], np.arange(-90.0, 131.0))
    live_file.scene.frame_start, live_file.scene.frame_end = 1, 40
    bpy.context.view_layer.update()
    for offset in (0.0, 60.0):
        added = [fcurve.modifiers.new("STEPPED") for fcurve in curves_of(obj).values()]
        for modifier in added:
            modifier.frame_step, modifier.frame_offset = step, offset
        bpy.context.view_layer.update()
        held = offset + np.trunc((np.arange(1.0, 41.0) - offset) / step) * step
        (shown,) = shown_worlds([obj], np.arange(1.0, 41.0))
        assert np.abs(shown - long[(held + 90.0).astype(int)]).max() < 1e-5
        for fcurve, modifier in zip(curves_of(obj).values(), added, strict=True):
            fcurve.modifiers.remove(modifier)


# Cycles

CYCLES = ("NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR")
FRAMES = (31.0, 35.0, 42.0)

MIRRORED = np.array((FRAMES[:-1], (FRAMES[0], FRAMES[0] + FRAMES[2] - FRAMES[1])))
"""The frames of the keys except the last, in rounds that run forwards and in rounds that run backwards."""

AROUND = np.arange(0.0, 76.0, 0.25)
"""Quarters of the scene's frames: more than two rounds on both sides."""


def cyclic(
    order: str = "QUATERNION", before: str = "REPEAT", after: str = "REPEAT", count: int = 0, how: str = "LINEAR"
) -> bpy.types.Object:
    """Return an object with three keys and Cycles, with the same rotation on the first and the last key."""
    obj = new_object("Tool", order)
    for path in ("location", rotation_path(obj)):
        values = random_values(obj, path, 3)
        if path != "location":
            values[2] = values[0]
        write_channel(obj, path, np.array(FRAMES), values, interpolation=how)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 75
    for fcurve in curves_of(obj).values():
        add_cycles(fcurve, Cycles(before, after, count, count))
        fcurve.update()
    return obj


def unrolled(
    obj: bpy.types.Object, before: str, after: str, count: int, frames: np.ndarray = AROUND, *, seams: bool = False
) -> np.ndarray:
    """Return a cyclic object's expected matrices on frames: those of the first round, possibly backwards or
    continued from the end of the previous round.

    On seams (unless requested) and after the last round, the matrices are Blender's own.
    """
    first, last = key_frames(obj)[[0, -1]]
    rounds = (frames - first) / (last - first)
    number = np.floor(rounds)
    kind = np.where(number > 0, after, np.where(number < 0, before, "NONE"))
    is_used = (number == 0) | ((kind != "NONE") & ((count == 0) | (np.abs(number) <= count)))
    chosen = np.flatnonzero(is_used & (seams | (rounds != number)))
    share = np.where((kind == "MIRROR") & (number % 2 == 1), 1.0 - (rounds - number), rounds - number)[chosen]
    times, places = np.unique(first + share * (last - first), return_inverse=True)
    plain = obj.copy()
    plain.animation_data.action = obj.animation_data.action.copy()
    for fcurve in curves_of(plain).values():
        for modifier in [*fcurve.modifiers]:
            fcurve.modifiers.remove(modifier)
    ends, bases = expected_bases(plain, (first, last)), expected_bases(plain, times)[places]
    bpy.data.actions.remove(plain.animation_data.action)
    bpy.data.objects.remove(plain)
    for row, index in enumerate(chosen):
        if kind[index] == "REPEAT_OFFSET":
            turn = np.linalg.matrix_power(ends[1][:3, :3] @ ends[0][:3, :3].T, int(number[index]))
            bases[row, :3, :3] = turn @ bases[row, :3, :3]
            bases[row, :3, 3] += number[index] * (ends[1] - ends[0])[:3, 3]
    result = expected_bases(obj, frames, keys=np.empty(0))
    result[chosen] = bases
    return result


def assert_unrolled(obj: bpy.types.Object, *cycles: object) -> None:
    assert_near(shown_worlds([obj], AROUND)[0], unrolled(obj, *cycles))


CASES = [
    *((*both, number % 3, "dq_sclerp") for number, both in enumerate(itertools.product(CYCLES, CYCLES))),
    *((kind, kind, 0, mode) for kind in CYCLES[1:3] for mode, one in KEYFRAME_MODES.items() if not one.is_smooth),
    *(("REPEAT", "REPEAT", 0, mode) for mode, one in KEYFRAME_MODES.items() if one.is_smooth),
]
"""Cycles before and after, their number of rounds, and the mode. Smooth modes have another test."""


@pytest.mark.parametrize(
    ("case", "how"),
    in_turn(CASES, [("QUATERNION", "BEZIER"), ("YZX", "SINE"), ("AXIS_ANGLE", "LINEAR")]),
)
def test_cycles_repeat_the_rigid_motion_with_the_easing_of_its_keys(live_file, case, how):
    (before, after, count, mode), (order, interpolation) = case, how
    obj = cyclic(order, before, after, count, interpolation)
    keys = snapshot(obj)
    set_mode(obj, mode)
    assert snapshot(obj) == keys
    if count == 1:
        set_turns(obj, 2)
    assert_unrolled(obj, before, after, count)


@pytest.mark.parametrize("kind", ["REPEAT_OFFSET", "MIRROR"])
def test_a_smooth_mode_flows_on_from_round_to_round(live_file, kind):
    obj = cyclic("QUATERNION", kind, kind)
    set_mode(obj, "motor_spline")
    shown = shown_worlds([obj], AROUND)[0]
    rounds, keys = np.arange(-4, 6)[:, None], np.array(FRAMES[:-1])
    times = (rounds * (FRAMES[-1] - FRAMES[0]) + (keys if kind != "MIRROR" else MIRRORED[rounds[:, 0] % 2])).ravel()
    poses = Poses.from_matrices(unrolled(obj, kind, kind, 0, times, seams=True))
    placed = matrices(interpolate(times, poses, AROUND, "motor_spline"))
    assert np.abs(shown - placed).max() < 1e-5 * np.abs(placed).max()


def test_a_wheel_rolls_on(live_file):
    obj = new_object("Wheel", "XYZ")
    write_channel(obj, "location", np.array(FRAMES), [(0, 0, 0), (1, 0, 0.1), (3, 0, 0)])
    write_channel(obj, "rotation_euler", np.array(FRAMES), [(0.3, 0, 0), (1.3, 0, 0), (3.3, 0, 0)])
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 75
    set_mode(obj, "dq_sclerp")
    repeat(obj, "REPEAT_OFFSET")
    assert problem_of(obj) == ""
    assert_unrolled(obj, "REPEAT_OFFSET", "REPEAT_OFFSET", 0)


def test_what_cannot_go_on_from_its_end_is_refused_with_the_way_out(live_file):
    turned = key(new_object("Turned"), FRAMES)
    set_mode(turned, "dq_sclerp")
    with pytest.raises(Refused, match=r"Turned ends with another rotation or scale.*choose Repeat"):
        repeat(turned, "REPEAT_OFFSET")
    for fcurve in curves_of(turned).values():
        add_cycles(fcurve, Cycles("REPEAT_OFFSET", "REPEAT_OFFSET", 0, 0))
    bpy.context.view_layer.update()
    assert problem_of(turned).startswith("Turned ends with another rotation or scale")
