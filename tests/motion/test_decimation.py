"""Tests of uniform decimation to a rate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.motion import decimate

GAP = np.concatenate((np.arange(10), np.arange(50, 60))) / 10.0


@pytest.mark.parametrize(
    ("times", "rate", "kept"),
    [
        (np.arange(181) / 90.0, 10.0, range(0, 181, 9)),
        ([0.0, 0.4, 0.9, 1.2, 2.05], 1.0, [0, 2, 4]),
        ([0.0, 0.5, 1.5, 2.0], 1.0, [0, 1, 3]),
        (np.arange(50) / 90.0, 90.0, range(50)),
        (np.arange(50) / 90.0, 1e9, range(50)),
        (GAP, 5.0, [0, 2, 4, 6, 8, 9, 10, 12, 14, 16, 18]),
        ([7.0], 5.0, [0]),
    ],
    ids=["even", "the nearest", "the earlier of two", "all", "far more than all", "a gap is not filled", "one sample"],
)
def test_the_samples_nearest_to_the_ticks_are_kept(times, rate, kept):
    assert decimate(times, rate).tolist() == list(kept)


@given(st.lists(st.floats(0.001, 0.5), min_size=1, max_size=200), st.floats(0.5, 60.0))
def test_keys_rise_start_at_the_first_sample_and_are_never_more_than_the_ticks(intervals, rate):
    times = 100.0 + np.cumsum(intervals)
    kept = decimate(times, rate)
    assert kept[0] == 0
    assert np.all(np.diff(kept) > 0)
    assert kept[-1] < len(times)
    assert len(kept) <= (times[-1] - times[0]) * rate + 1 + 1e-6
