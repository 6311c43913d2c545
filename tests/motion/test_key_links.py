"""Tests of the shortest path from key to key against an exhaustive search, and of its fast errors of splines."""

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, key_splines, reduce_keys, twists
from rigid_motion.motion.key_costs import Costs, SampleTracks
from rigid_motion.motion.key_search import KeySearch
from rigid_motion.motion.key_splines import SplineErrors
from rigid_motion.motion.quaternions import align_signs
from tests.motion.bodies import RADIUS, shell_errors, wandering

MEMORYLESS = [name for name, mode in MODES.items() if not mode.is_smooth]
TOLERANCES = (0.01, 0.03, 0.08)


def fewest_of_a_programme(times: np.ndarray, poses: Poses, mode: str, tolerance: float) -> int:
    """Return the fewest keys for a recording, if each segment counts as right or wrong by itself."""
    needed = [1]
    for end in range(1, len(times)):
        ways = []
        for start in range(end):
            part = slice(start, end + 1)
            errors = shell_errors(times[part], poses[part], np.array((0, end - start)), mode)
            if end - start == 1 or errors.max() <= tolerance:
                ways.append(needed[start] + 1)
        needed.append(min(ways))
    return needed[-1]


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("mode", MEMORYLESS)
def test_the_shortest_way_is_that_of_an_exhaustive_programme(mode, seed):
    times, poses = wandering(18, seed, (0.0, 0.01)[seed % 2], 40.0)
    keys = reduce_keys(times, poses, mode, TOLERANCES[seed], RADIUS)
    assert 2 < len(keys) < len(times)
    assert len(keys) == fewest_of_a_programme(times, poses, mode, TOLERANCES[seed])


@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline"])
def test_more_searches_leave_fewer_keys_of_the_same_mean_square_error(mode):
    fewer = 0
    for seed in range(4):
        times, poses = wandering(150, seed, 0.01, 40.0)
        few, many = (reduce_keys(times, poses, mode, 0.02, RADIUS, rms=True, tries=tries) for tries in (3, 0))
        assert np.sqrt(np.mean(shell_errors(times, poses, few, mode) ** 2)) <= 0.02 * (1.0 + 1e-9)
        assert len(few) <= len(many)
        fewer += len(few) < len(many)
    assert fewer >= 2


def test_long_segments_of_a_smooth_motion_do_not_make_the_search_many_times_as_long(monkeypatch):
    looked_at = []
    errors = SplineErrors.errors

    def counted(self, rows, counts):
        looked_at.append(counts.sum())
        return errors(self, rows, counts)

    monkeypatch.setattr(SplineErrors, "errors", counted)
    random, times = np.random.default_rng(110), np.arange(1500) / 60.0
    rates, sizes = 2.0 * np.pi * random.uniform(0.1, 3.0, (6, 8, 1)), random.normal(size=(6, 8, 1))
    waves = (sizes / rates * np.sin(rates * times + random.uniform(0.0, 2.0 * np.pi, (6, 8, 1)))).sum(axis=1)
    turns, _ = twists.exponential(np.concatenate((3.0 * waves[:3], np.zeros((3, len(times))))))
    poses = Poses(waves[3:].T, align_signs(turns.T))
    efforts = []
    for tries in (0, 1):
        looked_at.clear()
        KeySearch(SampleTracks(times, poses, "motor_spline", RADIUS, 0.9)).within(tries)
        efforts.append(sum(looked_at))
    assert efforts[1] <= 6 * efforts[0]


def errors_of(times: np.ndarray, poses: Poses, keys: np.ndarray) -> np.ndarray:
    costs = Costs(SampleTracks(times, poses, "motor_spline", RADIUS), 8)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(keys, 1, constant_values=-1), 4)
    return costs.errors(windows)


@pytest.mark.parametrize("remembered", [key_splines.REMEMBERED_EACH, 0])
@pytest.mark.parametrize("seed", range(2))
def test_errors_are_those_of_the_mode(seed, remembered, monkeypatch):
    monkeypatch.setattr(key_splines, "REMEMBERED_EACH", remembered)
    times, poses = wandering(400, seed, 1e-4 * (seed % 2))
    random = np.random.default_rng(seed)
    for count in (2, 3, 5, 20, 100):
        keys = np.sort(random.choice(np.arange(1, 399), count - 2, replace=False))
        keys = np.concatenate(((0,), keys, (399,)))
        errors = errors_of(times, poses, keys)
        assert np.allclose(errors, shell_errors(times, poses, keys, "motor_spline"), rtol=1e-9, atol=1e-9)
