"""F-curves evaluated in NumPy, against Blender's own evaluation of the same curve."""

from __future__ import annotations

import dataclasses

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.animation.fcurves.evaluation import evaluate
from rigid_motion.animation.fcurves.keys import EASINGS, INTERPOLATIONS, Keys, cycled
from tests.animation.fcurves.examples import (
    CODES,
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


@settings(max_examples=tried(300))
@given(curves())
def test_curves_of_all_kinds_have_blenders_values(keys):
    assert_as_blender(keys, frames_about(keys))


@given(curves(kinds=("BEZIER",)))
def test_handles_on_the_wrong_side_of_their_key_have_blenders_values(keys):
    assert_as_blender(dataclasses.replace(keys, left=keys.right, right=keys.left), frames_about(keys), update=False)


@settings(max_examples=tried(200))
@given(curves(), all_cycles)
def test_cycles_have_blenders_values(keys, cycles):
    keys = dataclasses.replace(keys, cycles=cycles)
    length = keys.times[-1] - keys.times[0] + 1.0
    frames = np.arange(16.0 * (keys.times[0] - 3.5 * length), 16.0 * (keys.times[-1] + 3.5 * length), 7.0) / 16.0
    assert_as_blender(keys, frames)


@settings(max_examples=tried(200))
@given(curves(kinds=("CONSTANT", "LINEAR", "QUAD"), gaps=(0.0, 2.0**-14, 2.0**-13, 2.0**-12, 1.0)), st.data())
def test_keys_on_the_same_frame_or_close_to_it_have_blenders_values(keys, data):
    keys = dataclasses.replace(keys, points=keys.points - (keys.points[0, 0, 0], 0.0))
    near = data.draw(st.sampled_from((0.0, 2.0**-15, 2.0**-14, 2.0**-13, 0.25)))
    frames = np.unique(np.concatenate([keys.times + offset for offset in (-near, 0.0, near)]))
    assert_as_blender(dataclasses.replace(keys, left=None, right=None), frames, update=False)


@settings(max_examples=tried(100))
@given(curves(), st.none() | all_cycles)
def test_frames_as_they_are_have_the_values_of_rounded_ones_nearby(keys, cycles):
    keys = dataclasses.replace(keys, cycles=cycles)
    frames = frames_about(keys)
    ((exact,),) = evaluate([keys], [frames], exact=True)
    np.testing.assert_array_equal(exact, evaluate_one(keys, frames))


def test_a_segment_is_smooth_on_frames_as_they_are():
    """In single precision there are steps, far out."""
    keys = keys_of((100_000, 100_010), (0, 1))
    frames = 100_000.0 + np.linspace(1.0, 9.0, 1001)
    ((exact,),) = evaluate([keys], [frames], exact=True)
    np.testing.assert_allclose(exact, (frames - 100_000.0) / 10.0, atol=1e-12)
    assert np.abs(evaluate_one(keys, frames) - exact).max() > 1e-4


@pytest.mark.parametrize("easing", EASINGS.values())
@pytest.mark.parametrize("interpolation", CODES)
@pytest.mark.parametrize("value", [3.0, -3.0, 0.0], ids=["rising", "falling", "level"])
def test_every_interpolation_and_easing_has_blenders_values(interpolation, easing, value):
    codes = {name: code for code, name in EASINGS.items()}
    keys = keys_of(
        (1, 31, 51),
        (0, value, 1),
        interpolation,
        left=((-9, 0), (21, 1), (41, 0)),
        right=((16, 0), (41, 5), (61, 0)),
        easing=np.full(3, codes[easing], np.int32),
        easing_settings=np.array(((1.7, 1.7, 1.7), (4.0, 4.0, 4.0), (9.0, 0.0, 9.0))),
    )
    assert_as_blender(keys, np.arange(-10.0, 62.0, 0.125), tolerance=1e-6)


def test_a_curve_without_keys_is_0_as_in_blender():
    keys = keys_of((), ())
    with as_fcurve(keys) as fcurve:
        assert fcurve.evaluate(7.0) == 0.0
        assert evaluate_one(read_one(fcurve), np.array([-1.0, 7.0])).tolist() == [0.0, 0.0]


anything = st.sampled_from((np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-40, 0.0, 1.0, 2.0, 7.0))


@settings(max_examples=tried(300))
@given(st.integers(0, 5), st.data(), st.booleans(), st.none() | all_cycles)
def test_keys_that_are_no_numbers_do_not_break_the_evaluation(count, data, linear, cycles):
    def rows(*shape: int) -> np.ndarray:
        size = int(np.prod(shape))
        return np.array(data.draw(st.lists(anything, min_size=size, max_size=size)), np.float32).reshape(shape)

    codes = st.lists(st.sampled_from(tuple(INTERPOLATIONS)), min_size=count, max_size=count)
    keys = Keys(
        rows(1, count, 2),
        np.array(data.draw(codes), np.int32)[None],
        rows(1, count, 2),
        rows(1, count, 2),
        np.zeros((1, count), np.int32),
        rows(3, 1, count),
        linear,
        cycles,
    )
    frames = rows(20)
    for values in evaluate([keys, keys], [frames, frames]):
        assert values.shape == (1, 20)
    cycled(keys, frames)


@pytest.mark.parametrize(("name", "codes"), [("interpolation", INTERPOLATIONS), ("easing", EASINGS)])
def test_codes_are_those_of_blender(name, codes):
    items = bpy.types.Keyframe.bl_rna.properties[name].enum_items
    assert codes == {item.value: item.identifier for item in items}
