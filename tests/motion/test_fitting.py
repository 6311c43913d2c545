"""Tests of fitted keys: never worse than recorded poses, and near the truth for noisy recordings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from rigid_motion.motion import MODES, Poses, fit_keys, interpolate
from rigid_motion.motion.quaternions import normalise
from tests.motion.bodies import matrices, wandering
from tests.thoroughness import tried


def squares(times: np.ndarray, poses: Poses, keys: np.ndarray, at_keys: Poses, mode: str, radius: float) -> float:
    """Return the sum of squares that `fit_keys` minimises."""
    return float(np.sum(residuals(interpolate(times[keys], at_keys, times, mode), poses, radius) ** 2))


def residuals(shown: Poses, truth: Poses, radius: float) -> np.ndarray:
    """Return the errors of the origins and, by matrices, the chords of the shell: two rotations differ by 8 sin^2."""
    turned, turns = (matrices(Poses(some.positions, some.quaternions))[:, :3, :3] for some in (shown, truth))
    chords = turned - turns
    if truth.scales is not None:
        chords *= np.sqrt(shown.scales * truth.scales)[:, None, None]
    return np.concatenate(((shown.positions - truth.positions).ravel(), radius * np.sqrt(0.5) * chords.ravel()))


@settings(max_examples=tried(30))
@given(st.integers(3, 200), st.integers(0, 2**16), st.sampled_from(tuple(MODES)), st.sampled_from((0.02, 0.1, 2.0)))
def test_fitted_keys_are_never_worse_than_recorded_ones(count, seed, mode, radius):
    times, poses = wandering(count, seed)
    random = np.random.default_rng(seed)
    keys = np.unique(np.append((0, count - 1), random.integers(0, count, 1 + count // 9)))
    fitted = fit_keys(times, poses, keys, mode, radius)
    before, after = (squares(times, poses, keys, at, mode, radius) for at in (poses[keys], fitted))
    assert after <= before * (1.0 + 1e-9) + 1e-20


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "motor_spline_causal"])
def test_a_general_minimiser_finds_nothing_better(mode):
    times, poses = wandering(40, 3)
    keys = np.array((0, 14, 22, 39))
    fitted = fit_keys(times, poses, keys, mode)

    def off(numbers: np.ndarray) -> np.ndarray:
        rows = numbers.reshape(-1, 7)
        at_keys = Poses(rows[:, :3], normalise(rows[:, 3:]))
        shown = interpolate(times[keys], at_keys, times, mode)
        return residuals(shown, poses, 0.1)

    start = np.concatenate((poses[keys].positions, poses[keys].quaternions), axis=1).ravel()
    best = 2.0 * least_squares(off, start).cost
    assert squares(times, poses, keys, fitted, mode, 0.1) < 1.02 * best


def test_scales_stay_as_they_are():
    times, poses = wandering(100, 4)
    growing = Poses(poses.positions, poses.quaternions, np.linspace(1.0, 3.0, 100))
    keys = np.array((0, 30, 60, 99))
    fitted = fit_keys(times, growing, keys, "cga_slerp")
    np.testing.assert_array_equal(fitted.scales, growing.scales[keys])
    before, after = (squares(times, growing, keys, at, "cga_slerp", 0.1) for at in (growing[keys], fitted))
    assert after < before
