"""Tests of key reduction, with independently computed errors of the keys."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES, Poses, key_costs, key_search, reduce_keys, twists
from rigid_motion.motion.quaternions import normalise
from tests.motion.bodies import RADIUS, shell_errors, wandering
from tests.thoroughness import tried


@settings(max_examples=tried(60))
@given(
    st.integers(2, 250),
    st.integers(0, 2**16),
    st.sampled_from((0.0, 1e-4, 1e-2)),
    st.sampled_from((1e-5, 1e-3, 0.02, 1.0)),
    st.sampled_from(tuple(MODES)),
    st.sampled_from((0.0, 0.1, 2.0)),
    st.booleans(),
)
def test_the_error_stays_within_the_tolerance_everywhere(count, seed, noise, tolerance, mode, radius, growing):
    times, poses = wandering(count, seed, noise)
    if growing:
        poses = Poses(poses.positions, poses.quaternions, 1.0 + 0.5 * np.sin(7.0 * times))
    keys = reduce_keys(times, poses, mode, tolerance, radius)
    assert keys[0] == 0
    assert keys[-1] == count - 1
    assert np.all(np.diff(keys) > 0)
    assert shell_errors(times, poses, keys, mode, radius).max() <= tolerance * (1.0 + 1e-9) + 1e-12


@settings(max_examples=tried(30))
@given(st.integers(3, 250), st.integers(0, 2**16), st.sampled_from((1e-3, 0.02, 0.3)), st.sampled_from(tuple(MODES)))
def test_the_root_mean_square_stays_within_the_tolerance(count, seed, tolerance, mode):
    times, poses = wandering(count, seed)
    keys = reduce_keys(times, poses, mode, tolerance, RADIUS, rms=True)
    assert np.sqrt(np.mean(shell_errors(times, poses, keys, mode) ** 2)) <= tolerance * (1.0 + 1e-9)


@settings(max_examples=tried(30))
@given(st.integers(2, 200), st.integers(0, 2**16), st.integers(2, 40), st.booleans(), st.sampled_from(tuple(MODES)))
@example(count=89, seed=89, budget=3, rms=False, mode="dq_sclerp")  # The body is at rest.
def test_a_budget_is_spent_and_not_passed(count, seed, budget, rms, mode):
    times, poses = wandering(count, seed)
    keys = reduce_keys(times, poses, mode, radius=RADIUS, budget=budget, rms=rms)
    rests = not (np.ptp(poses.positions, axis=0).any() or np.ptp(poses.quaternions, axis=0).any())
    assert len(keys) == (2 if rests else min(budget, count))
    assert keys[0] == 0
    assert keys[-1] == count - 1


def error_of_bisecting(times: np.ndarray, poses: Poses, mode: str, budget: int, error: float) -> float:
    """Return the least error found by bisecting tolerances near a known error, for at most `budget` keys."""
    low, high, best = np.log(error / 4.0), np.log(2.0 * error), np.inf
    for _ in range(8):
        middle = 0.5 * (low + high)
        keys = reduce_keys(times, poses, mode, np.exp(middle))
        if len(keys) > budget:
            low = middle
        else:
            high, best = middle, min(best, error_of(times, poses, keys, mode))
    return best


def error_of(times: np.ndarray, poses: Poses, keys: np.ndarray, mode: str) -> float:
    return float(shell_errors(times, poses, keys, mode).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "budget"),
    [("lerp_slerp", 12), ("lerp_slerp", 40), ("motor_spline", 12), ("motor_spline", 40)],
)
def test_a_budget_is_spent_as_well_as_by_trying_tolerances(mode, budget):
    ratios = []
    for seed in (budget, 1, 2, 3):
        times, poses = wandering(250, seed)
        error = error_of(times, poses, reduce_keys(times, poses, mode, budget=budget), mode)
        ratios.append(error / error_of_bisecting(times, poses, mode, budget, error))
    assert sorted(ratios)[-2] <= 1.05
    assert max(ratios) <= 1.15


def test_blenders_curves_need_no_more_keys_within_an_error_than_a_budget_has():
    """The motion is a camera solved by a tracker: keys put where its jitter is largest would follow the jitter."""
    times, random = np.arange(221) / 24.0, np.random.default_rng(1)
    eased = (share := times / times[-1]) ** 2 * (3.0 - 2.0 * share)
    angle = np.radians(200.0 * eased)
    turn, _ = twists.exponential(np.concatenate((np.zeros((2, 221)), angle[None] / 2.0, np.zeros((3, 221)))))
    quaternions = turn.T + 0.001 * random.normal(size=(221, 4))
    positions = np.stack((np.cos(angle), np.sin(angle), 0.5 + 0.7 * eased), axis=1)
    jittery = Poses(positions + 0.006 * random.normal(size=(221, 3)), normalise(quaternions))
    error = error_of(times, jittery, reduce_keys(times, jittery, "bezier", radius=RADIUS, budget=10), "bezier")
    keys = reduce_keys(times, jittery, "bezier", 1.1 * error, RADIUS)
    assert len(keys) <= 10
    assert error_of(times, jittery, keys, "bezier") <= 1.1 * error * (1.0 + 1e-9)


@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_slerp", "cga_slerp", "motor_spline"])
def test_one_screw_needs_two_keys(mode):
    times = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.02, 300))
    turn, advance = twists.exponential(np.outer((0.3, 0.5, -0.2, 0.4, 0.1, 0.3), times - times[0]))
    assert reduce_keys(times, Poses(advance.T, turn.T), mode, 1e-9).tolist() == [0, 299]


@pytest.mark.parametrize("options", [{"tolerance": 1e-6}, {"budget": 30}, {"budget": 30, "rms": True}], ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_a_body_at_rest_has_two_keys(mode, options):
    poses = Poses(np.tile((1.0, 2.0, 3.0), (200, 1)), np.tile((0.5, 0.5, 0.5, 0.5), (200, 1)))
    assert reduce_keys(np.arange(200.0), poses, mode, **options).tolist() == [0, 199]


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "motor_spline_causal"])
def test_keys_are_the_same_whatever_is_remembered_or_put_off(mode, monkeypatch):
    times, poses = wandering(100, 7, 0.001)
    keys = reduce_keys(times, poses, mode, 0.02, RADIUS).tolist()
    monkeypatch.setattr(key_costs, "MAX_REMEMBERED_SEGMENTS", 10)
    assert reduce_keys(times, poses, mode, 0.02, RADIUS).tolist() == keys
    monkeypatch.setattr(key_search, "MIN_POSTPONED_POSES", 0)
    assert reduce_keys(times, poses, mode, 0.02, RADIUS).tolist() == keys


@pytest.mark.parametrize(("mode", "rms"), [("dq_sclerp", False), ("dq_sclerp", True), ("motor_spline", False)])
def test_a_long_recording_needs_no_more_keys_than_if_all_its_samples_were_keys_at_first(mode, rms, monkeypatch):
    times, poses = wandering(key_search.MAX_FULL_START_SAMPLES + 500, 3, 1e-3)
    keys = reduce_keys(times, poses, mode, 0.02, RADIUS, rms=rms)
    errors = shell_errors(times, poses, keys, mode)
    assert (np.sqrt(np.mean(errors**2)) if rms else errors.max()) <= 0.02 * (1.0 + 1e-9)
    monkeypatch.setattr(key_search, "MAX_FULL_START_SAMPLES", len(times))
    assert len(keys) < 1.03 * len(reduce_keys(times, poses, mode, 0.02, RADIUS, rms=rms))


def test_signs_of_quaternions_do_not_matter():
    times, poses = wandering(150, 6)
    flipped = Poses(poses.positions, poses.quaternions * np.random.default_rng(1).choice((-1, 1), (150, 1)))
    assert reduce_keys(times, flipped, tolerance=0.01).tolist() == reduce_keys(times, poses, tolerance=0.01).tolist()
