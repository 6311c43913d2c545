"""F-curves evaluated in NumPy, against Blender's own evaluation of the same curve."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.animation.fcurves import (
    BEZIER,
    CONSTANT,
    EASINGS,
    ELASTIC,
    INTERPOLATIONS,
    LINEAR,
    Cycles,
    Keys,
    cycled,
    cyclic_times,
    evaluate,
    read_keys,
)
from tests.thoroughness import tried

CODES = {name: code for code, name in INTERPOLATIONS.items()}
MODES = ("NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR")


@contextmanager
def blenders(keys: Keys, *, update: bool = True) -> Iterator[bpy.types.FCurve]:
    """`keys` as an F-curve. Without an update Blender leaves the handles as they are given."""
    action = bpy.data.actions.new("Measured")
    slot = action.slots.new("OBJECT", "Measured")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    fcurve = strip.channelbag(slot, ensure=True).fcurves.new("location", index=0)
    try:
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
            modifier = fcurve.modifiers.new("CYCLES")
            modifier.mode_before, modifier.mode_after = keys.cycles.before, keys.cycles.after
            modifier.cycles_before, modifier.cycles_after = keys.cycles.before_count, keys.cycles.after_count
        yield fcurve
    finally:
        bpy.data.actions.remove(action)


def read_one(fcurve: bpy.types.FCurve) -> Keys:
    (((places, keys),),) = read_keys([[fcurve]])
    assert places == [0]
    return keys


def evaluate_one(keys: Keys, frames: np.ndarray, **options: bool) -> np.ndarray:
    """The values of the only curve of these keys, shape (m,)."""
    ((values,),) = evaluate([keys], [frames], **options)
    return values


def joined(curves: Sequence[Keys]) -> Keys:
    """Curves that are keyed together, as one."""
    rows = {
        field.name: None
        if getattr(curves[0], field.name) is None
        else np.concatenate(
            [getattr(keys, field.name) for keys in curves], axis=1 if field.name == "easing_settings" else 0
        )
        for field in dataclasses.fields(Keys)[:6]
    }
    return dataclasses.replace(curves[0], **rows)


def assert_as_blender(keys: Keys, frames: np.ndarray, *, update: bool = True, tolerance: float = 1e-5) -> None:
    """The values are Blender's, within `tolerance` of the size of the curve, its handles and its swings."""
    with blenders(keys, update=update) as fcurve:
        read = read_one(fcurve)
        found = evaluate_one(read, frames)
        expected = np.array([fcurve.evaluate(frame) for frame in frames.tolist()])
    handles = [rows for rows in (read.left, read.right) if rows is not None]
    # What swings elastically has a size even where every frame happens on a zero of the sine.
    swings = [] if read.easing_settings is None else read.easing_settings[1][read.interpolation == ELASTIC].tolist()
    size = max(
        1e-30, np.abs(expected).max(), *(np.abs(rows[..., 1]).max() for rows in (read.points, *handles)), *swings
    )
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * size)


def keys_of(
    times: Sequence[float], values: Sequence[float], interpolation: str | Sequence[str] = "LINEAR", **others: object
) -> Keys:
    names = [interpolation] * len(times) if isinstance(interpolation, str) else interpolation
    codes = np.array([CODES[name] for name in names], dtype=np.int32)
    for name, rows in others.items():
        if name in ("left", "right"):
            others[name] = np.asarray(rows, np.float32)[None]
        elif name == "easing":
            others[name] = rows[None]
        elif name == "easing_settings":
            others[name] = np.asarray(rows, np.float32)[:, None]
    return Keys(np.column_stack((times, values)).astype(np.float32)[None], codes[None], **others)


def frames_about(keys: Keys) -> np.ndarray:
    """Frames on and between the keys, and far before and after them. Sixteenths are exact in single precision."""
    return np.arange(16.0 * (keys.times[0] - 60.0), 16.0 * (keys.times[-1] + 60.0), 7.0) / 16.0


def numbers(limit: float) -> st.SearchStrategy[float]:
    """Of all sizes up to the limit, none so small that it vanishes in single precision."""
    whole = st.integers(-1024, 1024).map(lambda number: number / 1024.0)
    return st.tuples(whole, st.sampled_from((1.0, 0.1, 1e-3))).map(lambda pair: limit * pair[0] * pair[1])


@st.composite
def curves(
    draw: st.DrawFn, kinds: Sequence[str] = tuple(CODES), gaps: Sequence[float] = (0.25, 1.0, 10.0, 37.5)
) -> Keys:
    """Curves of up to six keys, with handles that are short, long, or reach past the next key."""
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


@settings(max_examples=tried(300))
@given(curves())
def test_curves_of_all_kinds_have_blenders_values(keys):
    assert_as_blender(keys, frames_about(keys))


@settings(max_examples=tried(300))
@given(curves(kinds=("BEZIER",)))
def test_handles_of_any_length_have_blenders_values(keys):
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
        easing_settings=np.repeat(((1.7,), (4.0,), (9.0,)), 3, axis=1),
    )
    assert_as_blender(keys, np.arange(-10.0, 62.0, 0.125), tolerance=1e-6)


@pytest.mark.parametrize("interpolation", CODES)
@pytest.mark.parametrize("count", [1, 2])
def test_a_curve_goes_on_at_the_slope_of_its_last_handle_or_segment(interpolation, count):
    keys = keys_of(
        (10, 20)[:count],
        (1, 4)[:count],
        interpolation,
        left=((8, 0), (18, 3))[:count],
        right=((11, 2), (24, 3))[:count],
        linear=True,
    )
    assert_as_blender(keys, np.arange(-50.0, 80.0, 0.5))


def test_a_curve_that_is_level_but_for_rounding_keeps_its_value_as_in_blender():
    assert_as_blender(keys_of((1, 11, 21), (0, 5e-8, 2e-7), "BEZIER"), np.arange(1.0, 21.0, 0.5))


def test_a_curve_without_keys_is_0_as_in_blender():
    keys = keys_of((), ())
    with blenders(keys) as fcurve:
        assert fcurve.evaluate(7.0) == 0.0
        assert evaluate_one(read_one(fcurve), np.array([-1.0, 7.0])).tolist() == [0.0, 0.0]


def test_automatic_handles_have_blenders_values_on_a_thousand_frames():
    random = np.random.default_rng(5)
    with blenders(keys_of(np.linspace(1, 1000, 10).round(), random.normal(size=10), "BEZIER")) as fcurve:
        for key in fcurve.keyframe_points:
            key.handle_left_type = key.handle_right_type = "AUTO_CLAMPED"
        fcurve.update()
        frames = np.arange(1.0, 1001.0)
        found = evaluate_one(read_one(fcurve), frames)
        expected = [fcurve.evaluate(frame) for frame in frames.tolist()]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=3e-6)


@settings(max_examples=tried(50))
@given(st.lists(st.tuples(curves(), st.none() | all_cycles), min_size=2, max_size=8), st.booleans())
def test_curves_together_have_the_values_that_each_has_alone(drawn, unit_elastic):
    together = [dataclasses.replace(keys, cycles=cycles) for keys, cycles in drawn]
    together += [dataclasses.replace(keys, points=keys.points * (1, -2)) for keys in together]
    frames = frames_about(together[0])
    times = [frames, frames.copy(), frames[::3]] * len(together)
    found = evaluate(together, times[: len(together)], unit_elastic=unit_elastic)
    for keys, own_times, (own,) in zip(together, times, found, strict=False):
        alone = evaluate_one(keys, own_times, unit_elastic=unit_elastic)
        size = max(np.abs(alone).max(), *(np.abs(rows[..., 1]).max() for rows in (keys.points, keys.left, keys.right)))
        np.testing.assert_allclose(own, alone, rtol=0.0, atol=1e-6 * size)


@settings(max_examples=tried(50))
@given(st.lists(curves(), min_size=2, max_size=5), st.none() | all_cycles, st.booleans())
def test_curves_keyed_together_have_the_values_that_each_has_alone(drawn, cycles, unit_elastic):
    count = min(len(keys.times) for keys in drawn)
    fewer = {name: lambda rows: rows[:, :count] for name in ("points", "interpolation", "left", "right", "easing")}
    fewer["easing_settings"] = lambda rows: rows[..., :count]
    alone = []
    for keys in drawn:
        parts = {name: few(getattr(keys, name)) for name, few in fewer.items()}
        shift = drawn[0].points[:, :count, :1] - parts["points"][..., :1]
        # On the frames of the first; handles stay where they are, and keep timings apart.
        parts["points"] = parts["points"] + np.concatenate((shift, np.zeros_like(shift)), axis=2)
        alone.append(dataclasses.replace(keys, **parts, linear=drawn[0].linear, cycles=cycles))
    frames = frames_about(alone[0])
    (found,) = evaluate([joined(alone)], [frames], unit_elastic=unit_elastic)
    for keys, own in zip(alone, found, strict=True):
        expected = evaluate_one(keys, frames, unit_elastic=unit_elastic)
        size = max(np.abs(rows[..., 1]).max() for rows in (keys.points, keys.left, keys.right))
        np.testing.assert_allclose(own, expected, rtol=1e-9, atol=1e-6 * size)


def test_channels_are_read_together_that_are_keyed_together():
    same, later = keys_of((1, 5, 9), (2, 3, 4), "BEZIER"), keys_of((1, 6, 9), (2, 3, 4), "BEZIER")
    endless = keys_of((1, 5, 9), (2, 3, 4), "BEZIER", linear=True)
    with blenders(same) as a, blenders(later) as b, blenders(same) as c, blenders(endless) as d:
        (read,) = read_keys([[a, b, c, d]])
        assert [places for places, _ in read] == [[0, 2], [1], [3]]
        assert [keys.points.shape for _, keys in read] == [(2, 3, 2), (1, 3, 2), (1, 3, 2)]


def test_many_curves_on_many_frames_have_the_values_that_each_has_alone():
    """More than are worked on at once."""
    random = np.random.default_rng(8)
    points = random.normal(size=(40, 6))
    together = [
        keys_of(
            np.arange(0, 120, 20) + i % 3,
            row,
            "BEZIER",
            left=np.column_stack((np.arange(0, 120, 20) + i % 3 - 7, row)),
            right=np.column_stack((np.arange(0, 120, 20) + i % 3 + 5, row + 1.0)),
        )
        for i, row in enumerate(points)
    ]
    frames = np.linspace(-5.0, 110.0, 6000)
    for keys, (own,) in zip(together, evaluate(together, [frames] * 40), strict=True):
        np.testing.assert_allclose(own, evaluate_one(keys, frames), rtol=0.0, atol=1e-9)


@settings(max_examples=tried(50))
@given(curves(), st.none() | all_cycles)
def test_the_order_of_frames_does_not_matter(keys, cycles):
    keys = dataclasses.replace(keys, cycles=cycles)
    frames = frames_about(keys)
    order = np.random.default_rng(1).permutation(len(frames))
    rising, mixed = evaluate_one(keys, frames), evaluate_one(keys, frames[order])
    np.testing.assert_array_equal(mixed, rising[order])


def test_nothing_to_evaluate_gives_nothing():
    assert evaluate([], []) == []
    assert evaluate([keys_of((1, 2), (3, 4))], [np.empty(0)])[0].shape == (1, 0)


@pytest.mark.parametrize("easing", EASINGS)
def test_the_elastic_timing_of_channels_is_their_own_or_that_of_a_curve_from_0_to_1(easing):
    ways = (8.0, -3.0, 1.0)
    settings = {"easing": np.full(2, easing, np.int32), "easing_settings": ((0, 0), (1.5, 1.5), (7, 7))}
    together = [keys_of((1, 21), (0, way), "ELASTIC", **settings) for way in ways]
    frames = np.arange(1.0, 21.5, 0.25)
    alone = [evaluate_one(keys, frames) for keys in together]
    np.testing.assert_array_equal(np.concatenate(evaluate(together, [frames] * 3)), alone)
    np.testing.assert_array_equal(evaluate([joined(together)], [frames])[0], alone)
    unit = np.concatenate(evaluate(together, [frames] * 3, unit_elastic=True))
    np.testing.assert_allclose(unit, np.multiply.outer(ways, alone[2]), rtol=0.0, atol=1e-12)
    assert not np.allclose(unit[:2], alone[:2])


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
    # Cycles of next to no length are refused, and have a test of their own.
    with suppress(ValueError):
        cyclic_times(keys, keys.times, -10.0, 10.0)


def test_only_what_bears_on_the_values_is_read():
    names = ("left", "easing")
    read = {}
    for name, linear in (("LINEAR", True), ("BEZIER", False), ("BACK", False), ("BACK", True)):
        with blenders(keys_of((1, 5), (2, 3), name, linear=linear)) as fcurve:
            keys = read_one(fcurve)
            read[name, linear] = [getattr(keys, name) is not None for name in names]
            assert keys.times.tolist() == [1.0, 5.0]
            assert keys.values.tolist() == [[2.0, 3.0]]
    assert list(read.values()) == [[False, False], [True, False], [False, True], [True, True]]


def test_a_muted_cycles_modifier_is_left_out():
    with blenders(keys_of((1, 5), (2, 3), cycles=Cycles("REPEAT", "MIRROR", 0, 2))) as fcurve:
        assert read_one(fcurve).cycles == Cycles("REPEAT", "MIRROR", 0, 2)
        fcurve.modifiers[0].mute = True
        assert read_one(fcurve).cycles is None


EDITS: dict[str, Callable[[bpy.types.FCurve], None]] = {
    "frame": lambda fcurve: setattr(fcurve.keyframe_points[1].co, "x", 6.0),
    "value": lambda fcurve: setattr(fcurve.keyframe_points[1].co, "y", 6.0),
    "left handle": lambda fcurve: setattr(fcurve.keyframe_points[1].handle_left, "y", 6.0),
    "right handle": lambda fcurve: setattr(fcurve.keyframe_points[0].handle_right, "x", 3.0),
    "interpolation": lambda fcurve: setattr(fcurve.keyframe_points[0], "interpolation", "CONSTANT"),
    "easing": lambda fcurve: setattr(fcurve.keyframe_points[2], "easing", "EASE_IN"),
    "amplitude": lambda fcurve: setattr(fcurve.keyframe_points[2], "amplitude", 6.0),
    "key": lambda fcurve: fcurve.keyframe_points.insert(7.0, 1.0),
    "extrapolation": lambda fcurve: setattr(fcurve, "extrapolation", "LINEAR"),
    "cycles": lambda fcurve: fcurve.modifiers.new("CYCLES"),
}


@pytest.mark.parametrize("edit", EDITS)
def test_every_edit_shows_in_the_raw_bytes(edit):
    keys = keys_of((1, 5, 9), (2, 3, 4), ("BEZIER", "LINEAR", "ELASTIC"))
    with blenders(keys) as fcurve:
        before = read_one(fcurve).raw
        fcurve.keyframe_points[0].select_control_point = True
        fcurve.select = True
        assert read_one(fcurve).raw == before
        EDITS[edit](fcurve)
        assert read_one(fcurve).raw != before


def test_an_edit_of_a_cycles_modifier_shows_in_the_raw_bytes():
    with blenders(keys_of((1, 5), (2, 3), cycles=Cycles("REPEAT", "REPEAT", 0, 0))) as fcurve:
        before = read_one(fcurve).raw
        fcurve.modifiers[0].cycles_after = 3
        assert read_one(fcurve).raw != before


@settings(max_examples=tried(100))
@given(curves(), all_cycles)
def test_folded_times_have_the_values_of_the_cycles(keys, cycles):
    repeated = dataclasses.replace(
        keys, cycles=dataclasses.replace(cycles, before=cycles.before.removesuffix("_OFFSET"), after="MIRROR")
    )
    frames = frames_about(keys)
    folded, backwards = cycled(repeated, frames)
    expected, found = evaluate_one(repeated, frames), evaluate_one(keys, folded)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)
    assert not np.any(backwards & (frames >= keys.times[0]) & (frames <= keys.times[-1]))


@pytest.mark.parametrize("mode", MODES)
def test_time_runs_backwards_in_every_other_mirrored_cycle(mode):
    keys = keys_of((10, 14, 20), (0, 1, 3), cycles=Cycles(mode, mode, 0, 2))
    frames = np.array([-25.0, -12.0, -1.0, 5.0, 12.0, 23.0, 32.0, 41.0, 55.0])
    folded, backwards = cycled(keys, frames)
    expected = {
        "NONE": frames,
        "REPEAT": [15, 18, 19, 15, 12, 13, 12, 41, 55],
        "REPEAT_OFFSET": [15, 18, 19, 15, 12, 13, 12, 41, 55],
        "MIRROR": [15, 12, 19, 15, 12, 17, 12, 41, 55],
    }
    np.testing.assert_allclose(folded, expected[mode], atol=1e-5)
    before, after = cycled(keys, frames - 0.25)[0], cycled(keys, frames + 0.25)[0]
    np.testing.assert_array_equal(backwards, after < before)
    assert np.any(backwards) == (mode == "MIRROR")


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("NONE", [10, 14, 20]),
        ("REPEAT", [-10, -6, 0, 4, 10, 14, 20, 24, 30, 34, 40]),
        ("REPEAT_OFFSET", [-10, -6, 0, 4, 10, 14, 20, 24, 30, 34, 40]),
        ("MIRROR", [-10, -6, 0, 6, 10, 14, 20, 26, 30, 34, 40]),
    ],
)
def test_key_times_are_copied_into_every_cycle(mode, expected):
    keys = keys_of((10, 14, 20), (0, 1, 3), cycles=Cycles(mode, mode, 0, 2))
    assert cyclic_times(keys, keys.times, -10.0, 60.0).tolist() == expected


def test_key_times_of_other_channels_are_copied_where_they_are_inside_of_the_cycle():
    keys = keys_of((10, 20), (0, 1), cycles=Cycles("NONE", "REPEAT", 0, 0))
    assert cyclic_times(keys, np.array([5.0, 12.0, 25.0]), 0.0, 35.0).tolist() == [5.0, 12.0, 22.0, 25.0, 32.0]


def test_key_times_fold_back_onto_keys():
    keys = keys_of((1, 6, 9), (0, 1, 3), cycles=Cycles("MIRROR", "REPEAT", 0, 0))
    folded, _ = cycled(keys, cyclic_times(keys, keys.times, -100.0, 100.0))
    assert set(folded.tolist()) == {1.0, 6.0, 9.0}


def test_millions_of_short_cycles_are_refused():
    keys = keys_of((1, 1.001), (0, 1), cycles=Cycles("NONE", "REPEAT", 0, 0))
    with pytest.raises(ValueError, match=r"rounds of 0\.001.* frames are too many"):
        cyclic_times(keys, keys.times, 0.0, 1e6)


def test_the_codes_are_those_of_this_blender():
    kind = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items
    for name, code in (("CONSTANT", CONSTANT), ("LINEAR", LINEAR), ("BEZIER", BEZIER), ("ELASTIC", ELASTIC)):
        assert kind[name].value == code
    assert set(INTERPOLATIONS.values()) == set(kind.keys())
