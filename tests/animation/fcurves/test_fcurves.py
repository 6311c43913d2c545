"""F-curves evaluated in NumPy, compared with Blender's evaluation of the same curve, and handles fitted to values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_motion.animation.actions.channels import read_keys
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.fcurves.evaluation import evaluate
from rigid_motion.animation.fcurves.keys import EASINGS, ELASTIC, INTERPOLATIONS, KEY_TOLERANCE, Cycles, Keys, cycled
from rigid_motion.animation.fcurves.solvers import fit_together, solve_cubics
from tests.animation.modified import spare_fcurve
from tests.thoroughness import tried

CODES = {name: code for code, name in INTERPOLATIONS.items()}
MODES = ("NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR")


@contextmanager
def as_fcurve(keys: Keys, *, update: bool = True) -> Iterator[bpy.types.FCurve]:
    """Yield a Blender F-curve with the only curve of `keys`. Without `update`, handles stay exactly as given."""
    with spare_fcurve() as fcurve:
        points, count = fcurve.keyframe_points, len(keys.times)
        points.add(count)
        free = bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items["FREE"].value
        settings = np.zeros((3, count), np.float32) if keys.easing_settings is None else keys.easing_settings
        for name, values in {
            "co": keys.points,
            "interpolation": keys.interpolation,
            "handle_left_type": np.full(count, free, np.int32),
            "handle_right_type": np.full(count, free, np.int32),
            "handle_left": keys.points if keys.left is None else keys.left,
            "handle_right": keys.points if keys.right is None else keys.right,
            "easing": np.zeros(count, np.int32) if keys.easing is None else keys.easing,
            "back": settings[0],
            "amplitude": settings[1],
            "period": settings[2],
        }.items():
            points.foreach_set(name, np.ascontiguousarray(values).ravel())
        if update:
            fcurve.update()
        if keys.linear:
            fcurve.extrapolation = "LINEAR"
        if keys.cycles is not None:
            add_cycles(fcurve, keys.cycles)
        yield fcurve


def read_one(fcurve: bpy.types.FCurve) -> Keys:
    ((places, keys, *_),) = read_keys([fcurve])
    assert places == [0]
    return keys


def evaluate_one(keys: Keys, frames: np.ndarray) -> np.ndarray:
    """Return the values of the only curve of `keys`, shape (m,)."""
    ((values,),) = evaluate([keys], [frames])
    return values


def assert_as_blender(keys: Keys, frames: np.ndarray, *, update: bool = True) -> None:
    """Check that the values are Blender's, within 2e-6 of the size of the curve, its handles and its elastic swings."""
    with as_fcurve(keys, update=update) as fcurve:
        read = read_one(fcurve)
        result = evaluate_one(read, frames)
        expected = np.array([fcurve.evaluate(frame) for frame in frames.tolist()])
    handles = [rows for rows in (read.left, read.right) if rows is not None]
    # An elastic segment has a size even if every frame falls on a zero of the sine.
    swings = [] if read.easing_settings is None else read.easing_settings[1][read.interpolation == ELASTIC].tolist()
    size = max(
        1e-30, np.abs(expected).max(), *(np.abs(rows[..., 1]).max() for rows in (read.points, *handles)), *swings
    )
    np.testing.assert_allclose(result, expected, rtol=0.0, atol=2e-6 * size)


def keys_of(
    times: Sequence[float], values: Sequence[float], interpolation: str | Sequence[str] = "LINEAR", **others: object
) -> Keys:
    names = [interpolation] * len(times) if isinstance(interpolation, str) else interpolation
    codes = np.array([CODES[name] for name in names], dtype=np.int32)
    for name in others.keys() & {"left", "right", "easing", "easing_settings"}:
        rows = np.asarray(others[name], np.int32 if name == "easing" else np.float32)
        others[name] = np.expand_dims(rows, -2 if name == "easing_settings" else 0)
    return Keys(np.column_stack((times, values)).astype(np.float32)[None], codes[None], **others)


def frames_about(keys: Keys) -> np.ndarray:
    """Return frames on, between, far before and far after the keys. Sixteenths are exact in single precision."""
    return np.arange(16.0 * (keys.times[0] - 60.0), 16.0 * (keys.times[-1] + 60.0), 7.0) / 16.0


def numbers(limit: float) -> st.SearchStrategy[float]:
    """Numbers of all magnitudes up to the limit, none so small that it vanishes in single precision."""
    whole = st.integers(-1024, 1024).map(lambda number: number / 1024.0)
    return st.tuples(whole, st.sampled_from((1.0, 0.1, 1e-3))).map(lambda pair: limit * pair[0] * pair[1])


@st.composite
def curves(
    draw: st.DrawFn, kinds: Sequence[str] = tuple(CODES), gaps: Sequence[float] = (0.25, 1.0, 10.0, 37.5)
) -> Keys:
    """Curves of up to six keys. Their handles may be short, long, or reach past the next key."""
    count = draw(st.integers(1, 6))

    def each(strategy: st.SearchStrategy, *shape: int) -> np.ndarray:
        size = int(np.prod((*shape, count)))
        return np.array(draw(st.lists(strategy, min_size=size, max_size=size))).reshape(*shape, count)

    times = draw(st.sampled_from((0.0, 1.0, 1000.0, -500.0))) + np.cumsum(each(st.sampled_from(tuple(gaps))))
    values = each(numbers(draw(st.sampled_from((1.0, 1000.0)))))
    if draw(st.booleans()):
        values[:] = values[0]
    lengths = each(st.sampled_from((0.0, 0.125, 1.0, 4.0, 50.0)), 2)
    heights = each(numbers(1.0 + np.abs(values).max()), 2)
    return keys_of(
        times,
        values,
        each(st.sampled_from(tuple(kinds))).tolist(),
        left=np.column_stack((times - lengths[0], values + heights[0])),
        right=np.column_stack((times + lengths[1], values + heights[1])),
        easing=each(st.sampled_from(tuple(EASINGS))).astype(np.int32),
        easing_settings=(
            each(st.sampled_from((0.0, 1.70158, -2.0, 4.0))),
            each(st.sampled_from((0.0, 0.25, 1.0, 3.0))) * draw(st.sampled_from((1.0, np.abs(values).max()))),
            each(st.sampled_from((0.0, 4.0, 13.0, -3.0))),
        ),
        linear=draw(st.booleans()),
    )


all_cycles = st.builds(Cycles, st.sampled_from(MODES), st.sampled_from(MODES), st.integers(0, 3), st.integers(0, 3))


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


# Bezier segments: the parameter for a given time, and handles fitted to given values

NEAR_LEVEL = 0.5 + np.array((-1e-3, -1e-6, -1e-9, 1e-9, 1e-6, 1e-3))
T, TIMES = np.concatenate((np.linspace(0.0, 1.0, 1001), NEAR_LEVEL)), np.linspace(0.0, 1.0, 41)

lengths = st.integers(0, 64).map(lambda number: number / 64.0)


@pytest.mark.any_blender
@given(lengths, lengths)
@example(1.0, 1.0)
@example(0.0, 0.0)
@example(0.0, 1.0)
@example(1.0, 0.0)
def test_solving_finds_the_parameter_of_every_time(first, second):
    """The handles have these lengths, as fractions of the segment."""
    c1, c2, c3 = 3.0 * first, 3.0 * (1.0 - second - 2.0 * first), 3.0 * first + 3.0 * second - 2.0
    t = solve_cubics(T, np.array((c1, c2, c3))[:, None].repeat(len(T), axis=1))
    assert np.all((t > -1e-5) & (t < 1.0 + 1e-5))
    np.testing.assert_allclose(((c3 * t + c2) * t + c1) * t, T, rtol=0.0, atol=1e-9)


def segment(handles: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the values of a segment from (0, 0) to (1, 1)."""
    first, last = handles
    return evaluate_one(keys_of((0, 1), (0, 1), "BEZIER", left=((0, 0), last), right=(first, (1, 1))), times)


def mean(shares: np.ndarray, handles: np.ndarray, times: np.ndarray) -> np.ndarray:
    return sum(share * segment(each, times) for share, each in zip(shares, handles, strict=True))


ONES = (
    ((1 / 3, 0.0), (2 / 3, 1.0)),
    ((0.39, 0.0), (0.61, 1.0)),
    ((0.8, 0.0), (0.9, 1.0)),
    ((0.1, 0.7), (0.6, 1.3)),
    ((0.0, 0.0), (1.0, 1.0)),
    ((0.5, -0.6), (0.5, 1.6)),
    ((0.9, 0.1), (0.2, 0.8)),
)


@pytest.mark.any_blender
def test_one_segment_is_recovered_and_what_none_is_can_be_the_mean_of_several():
    random = np.random.default_rng(1)
    curved_and_in_time = np.array((((0.39, 0.2), (0.61, 0.7)), ((1 / 3, 0.5), (2 / 3, 1.1))))
    cases = [(curved_and_in_time, np.array((0.5, 0.5)), np.array((0.6, 0.4)), curved_and_in_time[[0, 0], :, 0], 1e-4)]
    for handles in ONES:
        handles = np.array((handles,))
        cases.append((handles, np.ones(1), np.ones(1), handles[..., 0], 1e-4))
    for _ in range(tried(20)):
        x = np.sort(random.uniform(0.05, 0.95, size=(4, 2)), axis=1)
        handles = np.stack((x, random.normal(0.5, 0.5, size=(4, 2))), axis=2)
        cases.append((handles, *random.dirichlet((2.0,) * 4, size=2), x, 2e-4))
    for handles, old, new, x, tolerance in cases:
        values = mean(old, handles, TIMES)
        result = fit_together(TIMES, values, new, x)
        assert np.abs(mean(new, result, TIMES) - values).max() < tolerance
        assert np.all((result[..., 0] >= 0.0) & (result[..., 0] <= 1.0))
