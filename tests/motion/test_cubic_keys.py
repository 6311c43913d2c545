"""Tests of fitting cubic keys: hand-made curves get their keys back, and any curve stays within the tolerance."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.cubic_keys import (
    CONSTANT_KIND,
    CUBIC_KIND,
    FIRST_SEGMENT_SAMPLES,
    LINEAR_KIND,
    CubicKeys,
    Samples,
    fitted,
    fitted_together,
    joined,
    values_at,
)
from rigid_motion.motion.quaternions import align_signs, normalise

ALLOWED = 5e-4

TIMES = np.arange(481) / 24


def hand_made(width: int, seed: int = 0) -> tuple[np.ndarray, CubicKeys]:
    """Return frames and keys with equal slopes on both sides; keys of four numbers are unit quaternions."""
    random = np.random.default_rng(seed)
    frames = np.concatenate(([0], np.cumsum(random.integers(6, 40, size=18)), [480]))
    values = random.normal(size=(len(frames), width))
    if width == 4:
        values = normalise(np.eye(4)[0] + 0.2 * values)
    slopes = np.gradient(values, TIMES[frames], axis=0)
    return frames, CubicKeys(TIMES[frames], values, slopes, slopes, np.full(len(frames), CUBIC_KIND))


def played(keys: CubicKeys, times: np.ndarray, *, are_turns: bool = False) -> np.ndarray:
    """Return the values of all-cubic curves according to SciPy."""
    parts = [
        CubicHermiteSpline(keys.times[[key, key + 1]], keys.values[[key, key + 1]], slopes, axis=0)
        for key, slopes in enumerate(np.stack((keys.leaving[:-1], keys.arriving[1:]), axis=1))
    ]
    segments = np.clip(np.searchsorted(keys.times, times, side="right") - 1, 0, len(parts) - 1)
    result = np.array([parts[segment](time) for segment, time in zip(segments, times, strict=True)])
    return normalise(result) if are_turns else result


def test_values_are_those_of_an_independent_spline():
    _, keys = hand_made(3)
    times = np.linspace(0.0, 20.0, 1234)
    assert np.allclose(values_at(keys, times), played(keys, times))


@pytest.mark.parametrize("width", [1, 3, 4])
def test_keys_of_hand_made_curves_come_back_on_their_own_frames(width):
    frames, true = hand_made(width)
    samples = played(true, TIMES, are_turns=width == 4)
    keys = fitted(TIMES, samples, ALLOWED, are_turns=width == 4)
    own = np.isin(keys.times, TIMES[frames])
    assert len(keys.times) <= len(frames)
    assert own.sum() >= 0.9 * len(frames)
    off = played(keys, TIMES, are_turns=width == 4) - samples
    assert np.linalg.norm(off, axis=1).max() <= ALLOWED


def test_a_segment_that_is_longer_than_any_that_is_tried_is_one():
    times = np.arange(5 * FIRST_SEGMENT_SAMPLES) / 24
    keys = fitted(times, (0.01 * times**3 - times)[:, None], 1e-6)
    assert len(keys.times) == 2


@pytest.mark.parametrize("steps", [False, True])
def test_steps_are_steps_or_lines_from_one_frame_to_the_next(steps):
    values = np.repeat([[0.0], [1.0], [0.3]], 100, axis=0)
    times = np.arange(len(values)) / 30
    keys = fitted(times, values, 1e-2, steps=steps)
    assert (keys.times * 30).round().tolist() == ([0, 100, 200, 299] if steps else [0, 99, 100, 199, 200, 299])
    assert keys.kinds.tolist() == (
        [CONSTANT_KIND] * 4 if steps else [CONSTANT_KIND, LINEAR_KIND] * 2 + [CONSTANT_KIND] * 2
    )
    assert np.array_equal(values_at(keys, times), values)


def test_holds_are_held_and_lines_are_lines():
    frames, levels = [0, 30, 90, 120], [0.0, 0.0, 1.0, 1.0]
    times = np.arange(121) / 30
    keys = fitted(times, np.interp(times * 30, frames, levels)[:, None], 1e-3)
    assert (keys.times * 30).round().tolist() == frames
    assert keys.kinds[:-1].tolist() == [CONSTANT_KIND, LINEAR_KIND, CONSTANT_KIND]


def test_slopes_on_both_sides_of_keys_agree_where_they_may():
    keys = fitted(TIMES, played(hand_made(3)[1], TIMES), ALLOWED)
    assert np.array_equal(keys.arriving[1:-1], keys.leaving[1:-1])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_curves_that_follow_one_another_are_joined(sign):
    _, true = hand_made(4)
    samples = played(true, TIMES, are_turns=True)
    parts = [
        fitted(TIMES[part], side * samples[part], ALLOWED, are_turns=True)
        for side, part in ((1.0, slice(0, 201)), (sign, slice(200, None)))
    ]
    off = played(joined(parts, are_turns=True), TIMES, are_turns=True) - samples
    assert np.linalg.norm(off, axis=1).max() <= ALLOWED


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 90), st.sampled_from([1, 3, 4]), st.booleans(), st.booleans())
@example(70, 70, 4, False, True)
def test_no_sample_of_two_groups_is_off_by_more_than_is_allowed(seed, count, width, steps, lines):
    """With uneven times, noise, holds, and a different tolerance at each sample."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.01, 0.1, size=count))
    values = np.cumsum(random.normal(size=(count, width)) * random.integers(0, 2, size=(count, 1)), axis=0)
    if width == 4:
        values = normalise(np.eye(4)[0] + 0.1 * values)
    allowed = random.uniform(0.01, 1.0, size=count)
    others = 0.1 * random.normal(size=(count, 2))
    groups = [Samples(values, allowed, are_turns=width == 4), Samples(others, allowed)]
    keys, keys_of_others = fitted_together(times, groups, steps=steps, lines=lines)
    assert np.array_equal(keys.times, keys_of_others.times)
    assert np.all(np.linalg.norm(values_at(keys_of_others, times) - others, axis=1) <= allowed * (1 + 1e-9))
    shown = values_at(keys, times)
    if width == 4:
        shown = normalise(shown)
        if lines:
            # These are stored as lines between rotations, which every player turns evenly.
            turning = Poses(np.zeros((len(keys.times), 3)), align_signs(keys.values))
            segment = np.clip(np.searchsorted(keys.times, times, side="right") - 1, 0, None)
            even = interpolate(keys.times, turning, times, "lerp_slerp").quaternions
            shown = np.where(keys.kinds[segment, None] == LINEAR_KIND, even, shown)
        values = values * np.sign(np.einsum("ij,ij->i", shown, values))[:, None]
    assert np.all(np.linalg.norm(shown - values, axis=1) <= allowed * (1 + 1e-9))
    assert np.isin(keys.times, times).all()
    assert keys.times[[0, -1]].tolist() == times[[0, -1]].tolist()
