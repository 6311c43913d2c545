"""Key reduction: what it promises of its keys, recomputed apart from it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rigid_motion.motion import MODES, Poses, interpolate, reduce_keys, repair, twists
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion_batch.recordings import read_trajectories
from tests.balls import largest_displacements
from tests.recordings import RECORDINGS
from tests.thoroughness import sample, tried

RADIUS = 0.1


def shell_errors(times: np.ndarray, poses: Poses, keys: np.ndarray, mode: str, radius: float = RADIUS) -> np.ndarray:
    """The largest displacement of any point within the radius on every sample, by singular values of matrices."""
    shown = interpolate(times[keys], poses[keys], times, mode)
    a, b = (Rotation.from_quat(some.quaternions, scalar_first=True).as_matrix() for some in (shown, poses))
    return largest_displacements(shown.positions - poses.positions, radius * (a - b))


def wandering(count: int, seed: int, noise: float = 0.0, rough: float = 3.0) -> tuple[np.ndarray, Poses]:
    """A recording at uneven times: a smooth walk of a body, with rests, and noise on top."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.005, 0.02, count))
    knots = np.linspace(times[0], times[-1], max(4, int(rough * (times[-1] - times[0]))))
    values = np.cumsum(random.normal(size=(len(knots), 6)) * (random.uniform(size=(len(knots), 1)) > 0.3), axis=0)
    rows = np.array([np.interp(times, knots, column) for column in values.T])
    width = min(15, count)
    smooth = np.array([np.convolve(row, np.ones(width) / width, mode="same") for row in rows])
    turn, _ = twists.exponential(np.concatenate((smooth[:3], np.zeros((3, count)))))
    quaternions = turn.T + noise * random.normal(size=(count, 4))
    positions = 0.3 * smooth[3:].T + noise * random.normal(size=(count, 3))
    return times, Poses(positions, align_signs(normalise(quaternions)))


@settings(max_examples=tried(60))
@given(
    st.integers(2, 250),
    st.integers(0, 2**16),
    st.sampled_from((0.0, 1e-4, 1e-2)),
    st.sampled_from((1e-5, 1e-3, 0.02, 1.0)),
    st.sampled_from(tuple(MODES)),
    st.sampled_from((0.0, 0.1, 2.0)),
)
def test_the_error_stays_within_the_tolerance_everywhere(count, seed, noise, tolerance, mode, radius):
    times, poses = wandering(count, seed, noise)
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
def test_a_budget_is_spent_and_not_passed(count, seed, budget, rms, mode):
    times, poses = wandering(count, seed)
    keys = reduce_keys(times, poses, mode, radius=RADIUS, budget=budget, rms=rms)
    assert len(keys) == min(budget, count)
    assert keys[0] == 0
    assert keys[-1] == count - 1


def error_of_bisecting(
    times: np.ndarray, poses: Poses, mode: str, budget: int, error: float, *, rms: bool = False
) -> float:
    """The least error of the keys of eight tolerances, about one that is known, that are no more than a budget."""
    low, high, best = np.log(error / 4.0), np.log(2.0 * error), np.inf
    for _ in range(8):
        middle = 0.5 * (low + high)
        keys = reduce_keys(times, poses, mode, np.exp(middle), rms=rms)
        if len(keys) > budget:
            low = middle
        else:
            high, best = middle, min(best, error_of(times, poses, keys, mode, rms=rms))
    return best


def error_of(times: np.ndarray, poses: Poses, keys: np.ndarray, mode: str, *, rms: bool = False) -> float:
    errors = shell_errors(times, poses, keys, mode)
    return float(np.sqrt(np.mean(errors**2)) if rms else errors.max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "budget"),
    [("lerp_slerp", 12), ("lerp_slerp", 40), ("dq_sclerp", 12), ("motor_spline", 12), ("motor_spline", 40)],
)
def test_a_budget_is_spent_as_well_as_by_trying_tolerances(mode, budget):
    """All but one of 30 are within a twentieth, and that one within a seventh."""
    ratios = []
    for seed in (budget, 1, 2, 3, 4, 5):
        times, poses = wandering(250, seed)
        error = error_of(times, poses, reduce_keys(times, poses, mode, budget=budget), mode)
        ratios.append(error / error_of_bisecting(times, poses, mode, budget, error))
    assert sorted(ratios)[-2] <= 1.05
    assert max(ratios) <= 1.15


@pytest.mark.parametrize("mode", ["dq_sclerp", "pga_slerp", "cga_slerp", "motor_spline"])
def test_one_screw_needs_two_keys(mode):
    times = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.02, 300))
    turn, advance = twists.exponential(np.outer((0.3, 0.5, -0.2, 0.4, 0.1, 0.3), times - times[0]))
    assert reduce_keys(times, Poses(advance.T, turn.T), mode, 1e-9).tolist() == [0, 299]


@pytest.mark.parametrize("mode", MODES)
def test_a_body_at_rest_needs_two_keys(mode):
    poses = Poses(np.tile((1.0, 2.0, 3.0), (200, 1)), np.tile((0.5, 0.5, 0.5, 0.5), (200, 1)))
    assert reduce_keys(np.arange(200.0), poses, mode, 1e-6).tolist() == [0, 199]


def greedy(times: np.ndarray, poses: Poses, tolerance: float) -> np.ndarray:
    """Keys put in one after the other, each where the error is largest."""
    keys = [0, len(times) - 1]
    while (errors := shell_errors(times, poses, np.array(keys), "motor_spline")).max() > tolerance:
        keys = sorted({*keys, int(np.argmax(errors))})
    return np.array(keys)


def test_signs_of_quaternions_do_not_matter():
    times, poses = wandering(300, 6)
    flipped = Poses(poses.positions, poses.quaternions * np.random.default_rng(1).choice((-1, 1), (300, 1)))
    assert reduce_keys(times, flipped, tolerance=0.01).tolist() == reduce_keys(times, poses, tolerance=0.01).tolist()


def test_scale_is_part_of_the_pose():
    times, poses = wandering(300, 7)
    scales = 1.0 + 0.5 * np.sin(7.0 * times)
    growing = Poses(poses.positions, poses.quaternions, scales)
    keys = reduce_keys(times, growing, tolerance=0.002)
    shown = interpolate(times[keys], growing[keys], times, "motor_spline")
    assert RADIUS * np.abs(shown.scales - scales).max() <= 0.002 + 1e-9
    assert len(keys) > len(reduce_keys(times, poses, tolerance=0.002))


@pytest.fixture(scope="module")
def recordings() -> dict[str, tuple[np.ndarray, Poses]]:
    result = {}
    for path in sorted(RECORDINGS.glob("*")):
        if path.suffix != ".md":
            trajectory = read_trajectories(str(path)).trajectories[0]
            times, poses, _ = repair(trajectory.times, trajectory.rigid)
            result[path.name] = times, poses
    return result


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("mode", "tolerance"),
    [("lerp_slerp", 0.005), ("dq_sclerp", 0.005), ("motor_spline", 0.001), ("motor_spline", 0.03)],
)
def test_recordings_keep_to_the_tolerance(recordings, mode, tolerance):
    for name in sample(list(recordings)):
        times, poses = recordings[name]
        keys = reduce_keys(times, poses, mode, tolerance, RADIUS)
        assert shell_errors(times, poses, keys, mode).max() <= tolerance * (1.0 + 1e-9), name
