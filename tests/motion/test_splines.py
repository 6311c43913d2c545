"""Tests of the motor spline: its formula by matrices, no influence of distant keys, rests, and wild times."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, logm

from rigid_motion.motion import MODES, Poses, in_betweens, interpolate, twists
from rigid_motion.motion.poses import placed
from rigid_motion.motion.quaternions import angle_between, multiply, normalise, rotate, turned
from tests.motion.bodies import matrices
from tests.motion.cases import assert_same, random_quaternions
from tests.motion.test_properties import assert_close

SMOOTH = [name for name, mode in MODES.items() if mode.is_smooth and not mode.is_reference]
CAUSAL = "motor_spline_causal"
every_spline = pytest.mark.parametrize("mode", SMOOTH)


def motion(count: int = 9, seed: int = 0, scaled: bool = False) -> tuple[np.ndarray, Poses]:
    """Return uneven times, and keys that turn by all angles."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.2, 1.5, count))
    scales = np.exp(random.normal(size=count)) if scaled else None
    return times, Poses(random.normal(size=(count, 3)), random_quaternions(random, count), scales)


@every_spline
def test_a_key_has_a_say_in_no_more_segments_than_the_table_tells(mode):
    times, keys = motion(12)
    moments = np.linspace(times[0], times[-1], 1201)
    still = interpolate(times, keys, moments, mode)
    positions = keys.positions.copy()
    positions[6] += 1.0
    moved = interpolate(times, Poses(positions, keys.quaternions), moments, mode)
    changed = moments[np.abs(moved.positions - still.positions).max(axis=1) > 1e-12]
    first, last = times[6 - 1 - MODES[mode].ahead], times[6 + 1 + MODES[mode].behind]
    assert changed.min() > first
    assert changed.max() < last
    assert changed.min() < first + 0.05 * (times[6] - first)


@every_spline
@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
def test_where_a_key_repeats_but_for_single_precision_the_body_rests(mode, scaled):
    times, keys = motion(9, scaled=scaled)
    keys = keys[[0, 1, 2, 3, 3, 3, 4, 5, 6]]
    off = np.random.default_rng(4).uniform(-2e-7, 2e-7, (9, 3))
    keys = Poses(keys.positions + off, turned(keys.quaternions, off[::-1]), keys.scales)
    resting = interpolate(times, keys, np.linspace(times[3], times[5], 200), mode)
    assert_same(resting, keys[[3] * 200], 1e-6)


@every_spline
@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-9, 1e-12])
def test_turns_of_almost_half_a_turn_stay_sound(mode, short):
    times, _ = motion(7)
    random = np.random.default_rng(8)
    axes = normalise(random.normal(size=(7, 3)))
    turned = random_quaternions(random, 7)
    for place in range(1, 7):
        half = 0.5 * (np.pi - short)
        turned[place] = multiply(turned[place - 1], np.append(np.cos(half), np.sin(half) * axes[place]))
    keys = Poses(random.normal(size=(7, 3)), turned)
    moments = np.linspace(times[0], times[-1], 4001)
    path = interpolate(times, keys, moments, mode)
    steps = angle_between(path.quaternions[1:], path.quaternions[:-1]) / np.diff(moments)
    # Never faster than a few half turns in the time of the shortest segment.
    assert steps.max() < 4.0 * np.pi / np.diff(times).min()
    assert np.abs(np.linalg.norm(path.quaternions, axis=1) - 1.0).max() < 1e-12
    assert_close(interpolate(times, keys, times, mode), keys, 1e-9)


def slow_spline(times: np.ndarray, keys: Poses, moments: np.ndarray, mode: str) -> np.ndarray:
    """Return a motor spline by SciPy's matrix functions, moment by moment, shape (m, 4, 4)."""
    poses = matrices(keys)
    ways = [logm(np.linalg.inv(a) @ b).real for a, b in itertools.pairwise(poses)]
    moving = [bool(np.abs(way).max() > 1e-9) for way in ways]
    h = np.diff(times)
    speeds = [ways[0] / h[0]]
    for i in range(1, len(h)):
        # The slope, at this key, of the parabola through the keys before, here and after. The shorter segment's share
        # is at most the ratio of its time to the longer one's, and 0 if that is at most 1/16.
        short, long = (i - 1, i) if h[i - 1] < h[i] else (i, i - 1)
        share = min(h[long] / (h[long] + h[short]), h[short] / h[long]) if h[short] > h[long] / 16.0 else 0.0
        moves = moving[short] and moving[long]
        speeds.append((share * ways[short] / h[short] + (1.0 - share) * ways[long] / h[long]) * moves)
    speeds.append(ways[-1] / h[-1])
    if mode == CAUSAL:
        speeds = [ways[0] / h[0]] * 2
        for i in range(2, len(h) + 1):
            # The mean of the slopes, here and half-way here, of the parabola through this key and the two before, with
            # less bend if the segment before was shorter.
            last, here = ways[i - 2] / h[i - 2], ways[i - 1] / h[i - 1]
            bend = (here - last) * min(1.0 / (h[i - 2] + h[i - 1]), h[i - 2] / h[i - 1] ** 2)
            speeds.append(0.5 * ((here + bend * h[i - 1]) + here) * moving[i - 1])
    result = []
    for moment in moments:
        i = int(np.clip(np.searchsorted(times, moment, side="right") - 1, 0, len(h) - 1))
        u = (moment - times[i]) / h[i]
        leave, arrive = (moving[i] * (h[i] * speed - ways[i]) for speed in speeds[i : i + 2])
        # A stream leaves a key with a twist chosen before the time of the next key was known.
        part = min(1.0, 2.0 * h[i - 1] / h[i]) if mode == CAUSAL and i else 1.0
        # Beyond the ends, both go on in lines.
        left = u * (1 - u / part) ** 2 if 0.0 < u < part else min(u, 0.0)
        right = u**2 * (1 - u) if 0.0 < u < 1.0 else min(1.0 - u, 0.0)
        result.append(poses[i] @ expm(u * ways[i]) @ expm(left * leave - right * arrive))
    return np.array(result)


@every_spline
@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
@pytest.mark.parametrize("seed", range(2))
def test_the_motor_spline_is_that_of_matrix_exponentials(seed, scaled, mode):
    """With a rest, and beyond the ends; scales are exponentials of a spline of numbers."""
    times, keys = motion(8, seed, scaled)
    keys = keys[[0, 1, 2, 3, 3, 4, 5, 6]]
    moments = np.linspace(times[0] - 1.0, times[-1] + 1.0, 50)
    path = interpolate(times, keys, moments, mode, extrapolate=True)
    rigid, rigid_keys = (Poses(some.positions, some.quaternions) for some in (path, keys))
    np.testing.assert_allclose(matrices(rigid), slow_spline(times, rigid_keys, moments, mode), rtol=0, atol=1e-8)
    if scaled:
        numbers = Poses(np.log(keys.scales)[:, None] * (1.0, 0.0, 0.0), np.tile((1.0, 0.0, 0.0, 0.0), (8, 1)))
        expected = slow_spline(times, numbers, moments, mode)[:, 0, 3]
        np.testing.assert_allclose(np.log(path.scales), expected, rtol=0, atol=1e-8)


# -- wild times -------------------------------------------------------------------------------------------------------


@st.composite
def wild_times(draw, least: int = 3, most: int = 8) -> np.ndarray:
    """Key times whose neighbouring segments differ in length by factors of up to 10 000."""
    exponents = draw(st.lists(st.floats(-4.0, 0.0), min_size=least - 1, max_size=most - 1))
    return np.concatenate(((0.0,), np.cumsum(10.0 ** np.array(exponents))))


def wild_keys(times: np.ndarray, seed: int, spread: float) -> tuple[np.ndarray, Poses]:
    """Return turn angles, and keys that each follow the one before by a turn about a body axis and an advance."""
    random, count = np.random.default_rng(seed), len(times) - 1
    angles, ways = 3.0 * 10.0 ** -random.uniform(0.0, spread, (2, count))
    axes, advances = random.normal(size=(3, count)), ways * random.normal(size=(3, count))
    positions, quaternions = [random.normal(size=3)], [random_quaternions(random)]
    turns, ways = twists.exponential(np.concatenate((angles * (axes / np.linalg.norm(axes, axis=0)), advances)))
    for turn, way in zip(turns.T, ways.T, strict=True):
        positions.append(positions[-1] + rotate(quaternions[-1], way))
        quaternions.append(multiply(quaternions[-1], turn))
    return angles, Poses(np.array(positions), np.array(quaternions))


def filled(times: np.ndarray, keys: Poses, mode: str, count: int = 100) -> Poses:
    """Return poses at `count` equal steps of each segment, both keys included, shape (segments, count + 1)."""
    progress = np.tile(np.linspace(0.0, 1.0, count + 1), len(times) - 1)
    path = in_betweens(times, keys, [count + 1] * (len(times) - 1), progress, mode)
    shape = len(times) - 1, count + 1
    return Poses(path.positions.reshape(*shape, 3), path.quaternions.reshape(*shape, 4))


def turnings(path: Poses) -> np.ndarray:
    """Return how far the body turns in each segment, in radians."""
    return angle_between(path.quaternions[:, 1:], path.quaternions[:, :-1]).sum(axis=-1)


def lengths(path: Poses) -> np.ndarray:
    """Return the length of the origin's path in each segment."""
    return np.linalg.norm(np.diff(path.positions, axis=1), axis=-1).sum(axis=-1)


@given(wild_times(), st.integers(0, 2**16), st.floats(0.0, 4.0))
def test_whatever_the_keys_a_stream_stays_in_their_neighbourhood(times, seed, spread):
    """A stream leaves a key with up to 1.31 of the twist before and half the one before that, for twice the time
    before.
    """
    angles, keys = wild_keys(times, seed, spread)
    count = len(angles)
    path, screw = (filled(times, keys, mode) for mode in (CAUSAL, "dq_sclerp"))
    for amounts, away in (
        (lengths(screw), np.linalg.norm(path.positions - screw.positions, axis=-1)),
        (angles, angle_between(path.quaternions, screw.quaternions)),
    ):
        one, two = (np.concatenate((np.zeros(shift), amounts))[:count] for shift in (1, 2))
        bound = (4 / 27) * (1.31 * amounts + 0.5 * one + 2.0 * (1.31 * one + 0.5 * two))
        assert np.all(away.max(axis=1) <= bound + 1e-6 * amounts.max())


@given(wild_times(), st.integers(0, 2**16), st.floats(0.0, 4.0))
def test_whatever_the_keys_no_point_of_the_body_leaves_their_neighbourhood(times, seed, spread):
    """The bounds of docs/conventions.md hold for steps of any size, up to 10 000 times as large as their neighbours."""
    random, (angles, keys) = np.random.default_rng(seed), wild_keys(times, seed, spread)
    frame = Poses(random.normal(size=(1, 3)), random_quaternions(random, 1))
    for seated in (keys, placed(keys, frame[[0] * len(times)])):
        path, screw = (filled(times, seated, mode) for mode in ("motor_spline", "dq_sclerp"))
        for amounts, away in (
            (lengths(screw), np.linalg.norm(path.positions - screw.positions, axis=-1)),
            (angles, angle_between(path.quaternions, screw.quaternions)),
        ):
            around = np.convolve(np.concatenate(((0.0,), amounts, (0.0,))), (1.0, 0.0, 1.0), mode="valid")
            assert np.all(away.max(axis=1) <= (4 / 27) * around + 0.155 * amounts + 1e-6 * amounts.max())
        around = np.convolve(np.concatenate(((0.0,), angles, (0.0,))), (1.0, 0.0, 1.0), mode="valid")
        assert np.all(turnings(path) <= 1.37 * angles + (8 / 27) * around + 1e-6)
