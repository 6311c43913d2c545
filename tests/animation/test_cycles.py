"""Cycles: in each round the body moves as if its keys were real, and after the last round as in Blender's own mode.

With Repeat with Offset, this requires equal rotation and scale at both ends, or turns about one axis.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, problem_of, repeat, set_mode, set_turns, write_channel
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.fcurves.keys import Cycles
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, rotation_path, snapshot
from tests.animation.oracle import assert_near, expected_bases, matrices, shown_worlds
from tests.animation.scenes import key, new_object, random_values

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
    expected = interpolate(times, poses, AROUND, "motor_spline")
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
