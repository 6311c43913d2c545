"""Curves that share the work: the values of each are those that it has alone."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.animation.fcurves.evaluation import evaluate
from tests.animation.fcurves.examples import all_cycles, curves, evaluate_one, frames_about, joined
from tests.thoroughness import tried


@settings(max_examples=tried(50))
@given(st.lists(st.tuples(curves(), st.none() | all_cycles), min_size=2, max_size=8), st.booleans())
def test_curves_together_have_the_values_that_each_has_alone(drawn, unit_elastic):
    together = [dataclasses.replace(keys, cycles=cycles) for keys, cycles in drawn]
    together += [dataclasses.replace(keys, points=keys.points * (1, -2)) for keys in together]
    frames = frames_about(together[0])
    times = [frames, frames.copy(), frames[::3]] * len(together)
    result = evaluate(together, times[: len(together)], unit_elastic=unit_elastic)
    for keys, own_times, (own,) in zip(together, times, result, strict=False):
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
    (result,) = evaluate([joined(alone)], [frames], unit_elastic=unit_elastic)
    for keys, own in zip(alone, result, strict=True):
        expected = evaluate_one(keys, frames, unit_elastic=unit_elastic)
        size = max(np.abs(rows[..., 1]).max() for rows in (keys.points, keys.left, keys.right))
        np.testing.assert_allclose(own, expected, rtol=1e-9, atol=1e-6 * size)
