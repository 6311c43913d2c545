"""Frames folded back by a Cycles modifier, and the copies of keys in its rounds."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings

from rigid_motion.animation.curves.keys import Cycles, TooManyRounds, cycled, cyclic_times
from tests.animation.curves.examples import MODES, all_cycles, curves, evaluate_one, frames_about, keys_of
from tests.thoroughness import tried


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


def test_millions_of_short_cycles_are_refused():
    keys = keys_of((1, 1.001), (0, 1), cycles=Cycles("NONE", "REPEAT", 0, 0))
    with pytest.raises(TooManyRounds) as refused:
        cyclic_times(keys, keys.times, 0.0, 1e6)
    assert refused.value.period == pytest.approx(0.001, rel=1e-3)
