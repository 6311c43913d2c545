"""Uniform decimation to a rate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.motion import decimate


def test_every_ninth_sample_of_90_hz_is_10_hz():
    assert decimate(np.arange(181) / 90.0, 10.0).tolist() == list(range(0, 181, 9))


def test_the_nearest_sample_is_kept():
    assert decimate(np.array([0.0, 0.4, 0.9, 1.2, 2.05]), 1.0).tolist() == [0, 2, 4]


def test_of_two_equally_near_the_earlier_is_kept():
    assert decimate(np.array([0.0, 0.5, 1.5, 2.0]), 1.0).tolist() == [0, 1, 3]


@pytest.mark.parametrize("rate", [90.0, 1000.0, 1e9])
def test_a_rate_above_the_recordings_keeps_everything(rate):
    assert decimate(np.arange(50) / 90.0, rate).tolist() == list(range(50))


def test_a_gap_is_not_filled():
    times = np.concatenate((np.arange(10), np.arange(50, 60))) / 10.0
    kept = decimate(times, 5.0)
    assert np.all(np.diff(kept) > 0)
    assert 9 in kept
    assert 10 in kept


def test_one_sample_is_its_own_key():
    assert decimate(np.array([7.0]), 5.0).tolist() == [0]


@given(st.lists(st.floats(0.001, 0.5), min_size=1, max_size=200), st.floats(0.5, 60.0))
def test_keys_rise_start_at_the_first_sample_and_are_never_more_than_the_ticks(intervals, rate):
    times = 100.0 + np.cumsum(intervals)
    kept = decimate(times, rate)
    assert kept[0] == 0
    assert np.all(np.diff(kept) > 0)
    assert kept[-1] < len(times)
    assert len(kept) <= (times[-1] - times[0]) * rate + 1 + 1e-6
