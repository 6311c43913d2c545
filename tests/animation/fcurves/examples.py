"""F-curves for tests, random or written out, and the same F-curves in Blender."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from hypothesis import strategies as st

from rigid_motion.animation.actions.channels import read_keys
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.fcurves.evaluation import evaluate
from rigid_motion.animation.fcurves.keys import EASINGS, ELASTIC, INTERPOLATIONS, Cycles, Keys
from tests.animation.modified import spare_fcurve

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
