"""F-curves evaluated in NumPy, compared with Blender's own evaluation of the same curve."""

from __future__ import annotations

import dataclasses

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.animation.fcurves.keys import EASINGS, INTERPOLATIONS, KEY_TOLERANCE, Cycles, cycled
from tests.animation.fcurves.examples import (
    all_cycles,
    as_fcurve,
    assert_as_blender,
    curves,
    evaluate_one,
    frames_about,
    keys_of,
    read_one,
)
from tests.thoroughness import tried


@settings(max_examples=tried(500))
@given(curves() | curves(kinds=("BEZIER",)), st.none() | all_cycles, st.booleans())
def test_curves_of_all_kinds_have_blenders_values(keys, cycles, swapped):
    """Handles may be on the wrong side of their key."""
    length = keys.times[-1] - keys.times[0] + 1.0
    rounds = np.arange(16.0 * (keys.times[0] - 3.5 * length), 16.0 * (keys.times[-1] + 3.5 * length), 7.0) / 16.0
    frames = frames_about(keys) if cycles is None else rounds
    handles = {"left": keys.right, "right": keys.left} if swapped else {}
    assert_as_blender(dataclasses.replace(keys, cycles=cycles, **handles), frames, update=not swapped)


@settings(max_examples=tried(200))
@given(curves(kinds=("CONSTANT", "LINEAR", "QUAD"), gaps=(0.0, 2.0**-11, 1.0)), st.sampled_from((2.0**-14, 2.0**-12)))
def test_keys_on_the_same_frame_or_close_to_it_have_blenders_values_beside_them(keys, near):
    keys = dataclasses.replace(keys, points=keys.points - (keys.points[0, 0, 0], 0.0), left=None, right=None)
    times, counts = np.unique(keys.times, return_counts=True)
    times = times[(counts == 1) | (near > KEY_TOLERANCE)]
    assert_as_blender(keys, np.concatenate([times - near, times + near, [-1.0]]), update=False)


def test_a_curve_without_keys_is_0_as_in_blender():
    keys = keys_of((), ())
    with as_fcurve(keys) as fcurve:
        assert fcurve.evaluate(7.0) == 0.0
        assert evaluate_one(read_one(fcurve), np.array([-1.0, 7.0])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("name", "codes"), [("interpolation", INTERPOLATIONS), ("easing", EASINGS)])
def test_codes_are_those_of_blender(name, codes):
    items = bpy.types.Keyframe.bl_rna.properties[name].enum_items
    assert codes == {item.value: item.identifier for item in items}


@settings(max_examples=tried(100))
@given(curves(), all_cycles)
def test_folded_times_have_the_values_of_the_cycles(keys, cycles):
    repeated = dataclasses.replace(
        keys, cycles=dataclasses.replace(cycles, before=cycles.before.removesuffix("_OFFSET"), after="MIRROR")
    )
    frames = frames_about(keys)
    folded, backwards = cycled(repeated, frames)
    expected, result = evaluate_one(repeated, frames), evaluate_one(keys, folded)
    np.testing.assert_allclose(result, expected, rtol=1e-7, atol=1e-7)
    before, after = (cycled(repeated, frames + step)[0] for step in (-(2.0**-7), 2.0**-7))
    is_seam = abs(abs(after - before) - 2.0**-6) > 2.0**-10
    np.testing.assert_array_equal(backwards[~is_seam], (after < before)[~is_seam])


def test_endless_cycles_go_on_where_there_was_no_end():
    assert Cycles("REPEAT", "MIRROR", 3, 2).endless == Cycles("REPEAT", "MIRROR", 0, 0)
    assert Cycles("NONE", "MIRROR", 3, 2).endless == Cycles("MIRROR", "MIRROR", 0, 0)
    assert Cycles("REPEAT_OFFSET", "NONE", 3, 2).endless == Cycles("REPEAT_OFFSET", "REPEAT_OFFSET", 0, 0)
