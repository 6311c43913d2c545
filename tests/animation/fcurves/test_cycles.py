"""Frames folded back by a Cycles modifier."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings

from rigid_motion.animation.fcurves.keys import Cycles, cycled
from tests.animation.fcurves.examples import MODES, all_cycles, curves, evaluate_one, frames_about, keys_of
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
    ("before", "after", "expected"),
    [
        ("REPEAT", "MIRROR", ("REPEAT", "MIRROR")),
        ("NONE", "MIRROR", ("MIRROR", "MIRROR")),
        ("REPEAT_OFFSET", "NONE", ("REPEAT_OFFSET", "REPEAT_OFFSET")),
    ],
)
def test_endless_cycles_go_on_where_there_was_no_end(before, after, expected):
    assert Cycles(before, after, 3, 2).endless == Cycles(*expected, 0, 0)
