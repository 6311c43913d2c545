"""Tests of repairing recordings: the repairs are right, and each is reported."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rigid_motion.motion import Poses, interpolate, repair
from rigid_motion.motion.quaternions import normalise
from tests.motion.cases import random_quaternions


def recording(count: int = 20, seed: int = 0) -> tuple[np.ndarray, Poses]:
    """Return a sound recording at 100 Hz."""
    random = np.random.default_rng(seed)
    quaternions = normalise(np.array((1.0, 0, 0, 0)) + 0.1 * random.normal(size=(count, 4)))
    return np.arange(count) / 100.0, Poses(random.normal(size=(count, 3)), quaternions)


def test_a_sound_recording_stays_as_it_is():
    times, poses = recording()
    kept, mended, repairs = repair(times, poses)
    assert np.array_equal(kept, times)
    assert mended.quaternions == pytest.approx(poses.quaternions, abs=1e-15)
    assert repairs == []


def test_rows_of_nan_zero_quaternions_and_zero_scales_are_dropped_and_named():
    times, poses = recording()
    poses = Poses(poses.positions, poses.quaternions, np.ones(20))
    poses.positions[3, 1] = np.nan
    poses.quaternions[5] = 0.0
    poses.scales[0] = 0.0
    kept, _, repairs = repair(times, poses)
    assert np.array_equal(kept, np.delete(times, [0, 3, 5]))
    assert [r.rows.tolist() for r in repairs[:2]] == [[0, 3], [5]]
    assert "row 0, 3" in str(repairs[0])
    assert "zero" in str(repairs[1])


def test_of_equal_times_the_last_is_kept():
    times, poses = recording()
    times[4:7] = times[4]
    kept, mended, repairs = repair(times, poses)
    assert np.all(np.diff(kept) > 0)
    assert np.array_equal(mended.positions[4], poses.positions[6])
    assert "comes again" in str(repairs[0])


@pytest.mark.parametrize("time", [-1e25, 0.0, 1e6, 1.7e12, 1e25])
@pytest.mark.parametrize("row", [0, 7, 19])
def test_one_wild_time_stamp_costs_its_row_wherever_it_is_and_is_told(time: float, row: int):
    times, poses = recording()
    times += 1.7e9
    times[row] = time
    kept, _, repairs = repair(times, poses)
    assert np.array_equal(kept, np.delete(times, row))
    assert repairs[0].rows.tolist() == [row]
    assert f"such as {time:.6g} s (1: row {row})" in str(repairs[0])


def test_wild_times_at_both_ends_are_dropped_though_they_rise():
    times, poses = recording(count=100)
    times[:2], times[-2:] = [-1e20, -1e6], [1e6, 1e25]
    kept, _, repairs = repair(times, poses)
    assert np.array_equal(kept, times[2:-2])
    assert "far from that of all others, such as -1e+20 s (4: row 0, 1, 98, 99)" in str(repairs[0])


@pytest.mark.parametrize(
    ("count", "row", "pause"),
    [(2, -1, 1e25), (3, -1, 1e25), (100, -1, 5.0), (20, 10, 1e6)],
    ids=["two", "three", "a break", "two halves"],
)
def test_what_may_be_a_pause_is_left(count: int, row: int, pause: float):
    times, poses = recording(count)
    times[row:] += pause
    kept, _, _ = repair(times, poses)
    assert np.array_equal(kept, times)


def test_lengths_are_made_unit_and_only_said_where_they_were_off():
    times, poses = recording()
    poses.quaternions[2] *= 3.0
    poses.quaternions[9] *= 1.0001
    _, mended, repairs = repair(times, poses)
    assert np.linalg.norm(mended.quaternions, axis=1) == pytest.approx(1.0, abs=1e-15)
    assert repairs[0].rows.tolist() == [2]


def test_sign_flips_are_undone_and_counted_where_they_happen():
    times, poses = recording()
    poses.quaternions[5:9] *= -1.0
    _, mended, repairs = repair(times, poses)
    assert np.all(np.sum(mended.quaternions[1:] * mended.quaternions[:-1], axis=1) > 0.0)
    assert repairs[0].rows.tolist() == [5, 9]


def test_gaps_are_left_and_reported_with_their_length():
    times, poses = recording()
    times[11:] += 0.05
    kept, _, repairs = repair(times, poses)
    assert np.array_equal(kept, times)
    assert repairs[0].rows.tolist() == [11]
    assert "60 ms" in str(repairs[0])


wild = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, 1.0, 1.0, 2.0, -1e300, 1e-300])


@example([(0.0, 1.7e308, 0.0, 0.0)] * 3)
@example([(-1.8e305, 1.0, 0.0, 0.0), (-1.0, 1.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)])
@example([(-1.1e308, 1.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)])
@example([(1.7e308, 1.0, 0.0, 0.0), (-1e292, 1.0, 0.0, 0.0)])
@given(st.lists(st.tuples(wild, wild, wild, wild), max_size=30))
def test_whatever_comes_in_can_be_interpolated(rows):
    table = np.array(rows, dtype=float).reshape(-1, 4)
    quaternions = random_quaternions(np.random.default_rng(0), len(table)) * table[:, 1:2]
    times, poses, _ = repair(table[:, 0], Poses(table[:, 1:4], quaternions))
    assert np.all(np.diff(times) > 0)
    assert np.all(np.abs(np.linalg.norm(poses.quaternions, axis=1) - 1.0) < 1e-12)
    if len(times):
        assert len(interpolate(times, poses, times)) == len(times)
