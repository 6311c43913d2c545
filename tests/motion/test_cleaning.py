"""Tests of cleaning: jitter and spikes disappear, hits stay, and no sample moves by more than the tolerance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import Poses, Skeleton, clean, shell_error, standing
from rigid_motion.motion.banded import Banded
from rigid_motion.motion.contacts import slide, slide_ratios
from rigid_motion.motion.differences import turned_in_world
from rigid_motion.motion.jitter import jitter
from rigid_motion.motion.quaternions import align_signs, multiply, normalise, rotate
from tests.motion.bodies import in_root_space, largest_displacements, random_parents
from tests.thoroughness import combined, tried

NOISE, TURNS = 1e-3, np.radians(0.3)


def hand(seed: int, count: int = 600, rate: float = 90.0) -> tuple[np.ndarray, Poses]:
    """Return a motion of some decimetres and half turns, below two cycles per second."""
    random = np.random.default_rng(seed)
    times = np.arange(count) / rate
    frequencies = random.uniform(0.1, 2.0, (7, 4, 1))
    waves = np.sin(2.0 * np.pi * (frequencies * times + random.random((7, 4, 1)))) / (1.0 + frequencies)
    channels = (random.normal(size=(7, 4, 1)) * waves).sum(axis=1).T
    return times, Poses(0.2 * channels[:, :3], align_signs(normalise(channels[:, 3:] + (3.0, 0.0, 0.0, 0.0))))


def shaken(poses: Poses, seed: int) -> Poses:
    """Return the poses with white noise."""
    random = np.random.default_rng(seed)
    places, turns = random.normal(size=(2, len(poses), 3))
    quaternions = turned_in_world(poses.quaternions, TURNS * turns)
    return Poses(poses.positions + NOISE * places, align_signs(quaternions))


def rms(poses: Poses, truth: Poses) -> float:
    return float(np.sqrt(np.mean(shell_error(poses, truth) ** 2)))


@pytest.mark.parametrize("count", [4, 5, 6, 7, 8, 9, 13, 50, 101])
def test_the_solver_does_what_dense_matrices_do(count):
    random = np.random.default_rng(count)
    rows, weights, diagonal = random.normal(size=(count - 3, 4)), random.random(count - 3), random.random(count) + 0.1
    dense = np.zeros((count - 3, count))
    for own in range(count - 3):
        dense[own, own : own + 4] = rows[own]
    inverse = np.linalg.inv(np.diag(diagonal) + dense.T * weights @ dense)
    banded, sides = Banded(diagonal, rows, weights), random.normal(size=(count, 3))
    np.testing.assert_allclose(banded.solve(sides), inverse @ sides, atol=1e-9)
    for apart, found in enumerate(banded.inverse_diagonals()):
        np.testing.assert_allclose(found[: count - apart], np.diagonal(inverse, apart), atol=1e-9)


@pytest.mark.parametrize("count", [60, 100, 200, 600, 4000])
def test_white_noise_is_measured_as_it_is_however_short_the_recording(count):
    found = []
    for seed in range(200 if count < 600 else 10):
        times, truth = hand(seed, count)
        found += jitter(times, shaken(truth, seed))[:2]
    parts = np.reshape(found, (-1, 2)) / (NOISE, TURNS)
    # Not too low with few samples, and no more scattered than this many numbers must be.
    assert parts.mean() == pytest.approx(1.0, abs=0.02)
    assert parts.std() < 1.0 / np.sqrt(count)
    assert np.mean(np.abs(parts - 1.0) < 0.15) > (0.8 if count < 100 else 0.9)


def test_motion_without_noise_is_left_alone():
    times, truth = hand(1)
    cleaned = clean(times, truth)
    assert cleaned.noise.tolist() == [0.0, 0.0]
    assert cleaned.moved.max() == 0.0


@pytest.mark.parametrize("length", [1, 2, 3, 6])
def test_spikes_are_found_and_bridged(length):
    times, truth = hand(2)
    shaky = shaken(truth, 2)
    rows = np.concatenate([np.arange(first, first + length) for first in (60, 200, 350, 500)])
    positions = shaky.positions.copy()
    positions[rows] += (0.0, 0.08, 0.05)
    cleaned = clean(times, Poses(positions, shaky.quaternions), tolerance=0.004)
    assert np.flatnonzero(cleaned.spikes).tolist() == rows.tolist()
    assert shell_error(cleaned.poses, truth).max() < 0.006


@pytest.mark.parametrize(("length", "lost"), [(2, True), (6, True), (9, False)])
def test_a_pose_that_comes_again_where_others_jitter_is_a_lost_sample_but_not_what_stands_still(length, lost):
    times, truth = hand(3)
    shaky = shaken(truth, 3)
    rows = np.arange(300, 300 + length)
    positions, quaternions = shaky.positions.copy(), shaky.quaternions.copy()
    positions[rows], quaternions[rows] = positions[299], quaternions[299]
    cleaned = clean(times, Poses(positions, quaternions), tolerance=0.004)
    assert np.flatnonzero(cleaned.repeats).tolist() == (rows.tolist() if lost else [])
    assert not lost or shell_error(cleaned.poses, truth)[rows].max() < 0.006


@pytest.mark.parametrize(("shape", "late"), combined(("drum", "throw", "step"), (0.5, 0.0, 0.33)))
def test_a_hit_is_no_further_off_than_it_was_recorded_be_it_on_a_sample_or_between_two(shape, late):
    times = (np.arange(900) + late) / 90.0
    phase = np.mod(times, 1.0) - 0.5
    height = {
        "drum": 0.8 * np.abs(phase),
        "throw": 2.45 * (0.25 - phase**2),
        "step": 0.3 * np.floor(times) + 0.3 * np.clip(5.0 * np.mod(times, 1.0), 0.0, 1.0),
    }[shape]
    tilts = turned_in_world(np.tile([1.0, 0, 0, 0], (900, 1)), height[:, None] * (0.0, 1.0, 0.0))
    truth = Poses(np.stack([0.2 * np.sin(times), 0.1 * times, height], axis=1), tilts)
    hits, ratios = np.argsort(-np.abs(np.diff(height, 2)))[:12] + 1, []
    for seed in range(40, 43):
        shaky = shaken(truth, seed)
        cleaned = clean(times, shaky).poses
        assert rms(cleaned, truth) < 0.5 * rms(shaky, truth)
        ratios.append(rms(cleaned[hits], truth[hits]) / rms(shaky[hits], truth[hits]))
    assert np.median(ratios) < 1.01
    assert max(ratios) < 1.2


@pytest.mark.parametrize("seed", range(tried(12)))
def test_what_has_been_cleaned_is_not_moved_again(seed):
    random = np.random.default_rng(seed)
    count, size, turn = int(random.integers(60, 900)), 10 ** random.uniform(-4, -2), 10 ** random.uniform(-4, -2)
    times, truth = hand(seed, count, float(random.choice([30, 60, 90, 120])))
    noise = random.normal(size=(2, count, 3))
    noise[:, 1:] += random.choice([0.0, 0.5]) * noise[:, :-1]
    positions = truth.positions + size * noise[0]
    for row in random.integers(9, count - 9, count // 200):
        positions[row : row + 2] += random.uniform(0.05, 0.3)
    shaky = Poses(positions, align_signs(turned_in_world(truth.quaternions, turn * noise[1])))
    # A smaller tolerance would remove only part of the jitter each time.
    tolerance = 3.0 * (size * 3.0**0.5 + 0.1 * turn * 2.0**0.5)
    for allowed in (None, tolerance):
        cleaned = clean(times, shaky, allowed)
        assert clean(cleaned.times, cleaned.poses, allowed).moved.max() < 1e-6 * tolerance


@pytest.mark.parametrize("seed", range(2))
def test_the_world_the_clock_and_the_direction_of_time_do_not_matter(seed):
    times, truth = hand(seed)
    shaky, tolerance = shaken(truth, seed), 0.003
    cleaned = clean(times, shaky, tolerance)
    turn = normalise(np.array([0.3, 1.0, -0.7, 0.2]))

    def moved(poses: Poses) -> Poses:
        return Poses(rotate(turn, poses.positions) + np.arange(3.0), multiply(turn, poses.quaternions))

    for other, expected in (
        (clean(times, moved(shaky), tolerance).poses, moved(cleaned.poses)),
        (clean(3.0 * times + 5.0, shaky, tolerance).poses, cleaned.poses),
        (clean(-times[::-1], shaky[::-1], tolerance).poses[::-1], cleaned.poses),
    ):
        assert shell_error(other, expected).max() < 1e-4 * tolerance


def test_a_clock_that_jitters_is_steadied_and_only_the_jitter_goes():
    times, truth = hand(4)
    stamped, shaky = times + np.random.default_rng(4).normal(size=len(times)) * 0.001, shaken(truth, 4)
    cleaned = clean(stamped, shaky)
    assert np.abs(np.diff(cleaned.times, 2)).max() < 1e-9
    assert cleaned.noise == pytest.approx((NOISE, TURNS), rel=0.15)
    assert rms(cleaned.poses, truth) < 0.6 * rms(shaky, truth)
    assert not cleaned.spikes.any()
    assert not cleaned.repeats.any()


def test_what_cannot_be_cleaned_is_said():
    times, truth = hand(1, 20)
    assert clean(times[:8], truth[:8]).moved.max() == 0.0
    with pytest.raises(ValueError, match="leaves nothing to clean"):
        clean(times, truth, 0.0)
    with pytest.raises(ValueError, match="times need to rise"):
        clean(times[::-1], truth)
    with pytest.raises(ValueError, match="do not fit"):
        clean(times[:-1], truth)


def test_noise_is_not_found_in_what_is_short():
    times, truth = hand(1, 9)
    assert jitter(times, truth)[:2] == (0.0, 0.0)


@pytest.mark.parametrize("tolerance", [0.002, 0.01])
def test_a_body_is_cleaned_joint_by_joint_and_bounded_in_the_world(tolerance):
    skeleton = Skeleton([-1, 0, 1, 2, 0])
    times, root = hand(6, 300)
    joints = [root] + [
        Poses(np.tile([0.0, 0.3, 0.0], (300, 1)), hand(seed, 300)[1].quaternions) for seed in (7, 8, 9, 10)
    ]
    truth = Poses(np.stack([each.positions for each in joints]), np.stack([each.quaternions for each in joints]))
    shaky = [shaken(each, seed) for seed, each in enumerate(joints)]
    positions = np.stack([shaky[0].positions, *(each.positions for each in joints[1:])])
    poses = Poses(positions, np.stack([each.quaternions for each in shaky]))
    cleaned = clean(times, poses, tolerance, 0.05, skeleton)
    assert cleaned.noise[0, 1:].tolist() == [0.0] * 4
    assert not cleaned.spikes.any()
    world, before, real = (skeleton.in_root_space(each) for each in (cleaned.poses, poses, truth))
    assert shell_error(world, before, 0.05).max() <= tolerance * (1.0 + 1e-9)
    if tolerance > 0.005:
        assert rms(world, real) < 0.7 * rms(before, real)


@settings(max_examples=tried(60), deadline=None)
@given(st.integers(0, 10**6), st.none() | st.floats(1e-5, 0.1), st.integers(8, 200), st.integers(1, 6))
def test_what_stands_slides_no_further_than_it_did_and_nothing_is_moved_by_more(seed, tolerance, count, joints):
    random, radius = np.random.default_rng(seed), 10.0 ** -(seed % 3)
    times = np.cumsum(random.uniform(0.001, 0.1, count))
    walk = np.cumsum(
        random.normal(size=(joints, count, 7)) * random.choice([0, 1e-3, 0.1, 3], (joints, count, 1)), axis=1
    )
    walk += random.choice([0, 1e-3, 1e-2]) * random.normal(size=walk.shape) + random.normal(size=(joints, 1, 7))
    poses = Poses(walk[..., :3], np.stack([align_signs(normalise(rows)) for rows in walk[..., 3:]]))
    stands = np.repeat(random.random((joints, count // 8 + 1)) < 0.5, 8, axis=1)[:, :count]
    skeleton = Skeleton(random_parents(random, joints))
    cleaned = clean(times, poses, tolerance, radius, skeleton, stands=stands)
    out = cleaned.spikes | cleaned.repeats
    for own in skeleton.levels[1:]:
        out[own] |= out[skeleton.parents[own]]
    assert np.array_equal(cleaned.stands, stands & ~out)
    after, before = (in_root_space(each, skeleton.parents) for each in (cleaned.poses, poses))
    moved = largest_displacements(after, before, radius)
    np.testing.assert_allclose(cleaned.moved, moved, rtol=1e-6, atol=1e-9)
    assert tolerance is None or moved[~out].max(initial=0.0) <= tolerance * (1.0 + 1e-9)
    after, before = (each[..., :3, 3] for each in (after, before))
    assert slide_ratios(after, before, cleaned.stands, 0.25 * (tolerance or 0.0)).max() <= 1.0 + 1e-9


@pytest.mark.parametrize("seed", range(2))
def test_a_foot_that_stood_still_stays_so_and_moves_nothing_else_further_than_it_was_to_be(seed):
    """A jittering hip above a stepping foot, joined by a leg of the length that this requires."""
    times, still = np.arange(400) / 60.0, np.tile([1.0, 0, 0, 0], (400, 1))
    steps = np.floor(times) + np.clip(5.0 * np.mod(times, 1.0) - 4.0, 0.0, 1.0)
    foot = np.outer(0.2 * steps + 0.1, (1.0, 0, 0))
    truth = np.stack([0.2 * times, 0.02 * np.sin(6.0 * times), 0.9 + 0.02 * np.cos(12.0 * times)], axis=1)
    hip = truth + 0.002 * np.random.default_rng(seed).normal(size=(400, 3))
    leg = foot - hip
    lengths = np.linalg.norm(leg, axis=1)
    turns = align_signs(normalise(np.column_stack([lengths - leg[:, 2], np.cross((0.0, 0.0, -1.0), leg)])))
    poses = Poses(np.stack([hip, 0.0 * hip, np.outer(lengths, (0, 0, -1.0))]), np.stack([still, turns, still]))
    skeleton = Skeleton([-1, 0, 1])
    before = skeleton.in_root_space(poses).positions
    np.testing.assert_allclose(before[2], foot, atol=1e-12)
    stands = standing(times, before, shaky=True)
    assert stands.sum(axis=1)[:2].tolist() == [0, 0]
    free, held = (clean(times, poses, None, 0.03, skeleton, stands=each) for each in (None, stands))
    after = skeleton.in_root_space(held.poses).positions
    assert slide(before, stands) < 1e-12
    assert slide(skeleton.in_root_space(free.poses).positions, stands) > 0.003
    assert slide(after, stands) < 1e-8
    assert (held.moved.max(axis=1) <= free.moved.max(axis=1) * (1.0 + 1e-9)).all()
    assert np.linalg.norm(after[0] - truth) < 1.05 * np.linalg.norm(hip - truth)
