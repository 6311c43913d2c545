"""What segments between keys cost, recomputed apart from the search."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, Skeleton, interpolate, key_costs, key_search, reduce_keys, shell_error
from rigid_motion.motion.bodies import Body
from rigid_motion.motion.key_costs import Costs, Recording
from rigid_motion.motion.poses import placed
from rigid_motion.motion.segments import prepare_within
from rigid_motion.motion.skeleton_levels import Level
from tests.motion.bodies import wandering_body
from tests.motion.test_reduction import RADIUS, shell_errors, wandering

TOLERANCE = 0.02


@pytest.mark.parametrize("mode", MODES)
def test_the_costs_of_keys_are_sums_of_powers_of_the_errors_between_them(mode):
    times, poses = wandering(120, 3, 0.01)
    keys = np.unique(np.append(np.random.default_rng(5).choice(120, 12, replace=False), (0, 119)))
    costs = Costs(Recording(times, poses, mode, RADIUS, TOLERANCE), 8)
    ended = np.pad(keys, costs.reach, constant_values=-1)
    cost, peak = costs.of(np.lib.stride_tricks.sliding_window_view(ended, costs.keys))
    errors = shell_errors(times, poses, keys, mode) / TOLERANCE
    errors[keys] = 0.0
    assert cost == pytest.approx(np.add.reduceat(errors**8, keys[:-1]), rel=1e-6, abs=1e-30)
    assert peak == pytest.approx(np.maximum.reduceat(errors, keys[:-1]), rel=1e-8, abs=1e-9)


def test_what_is_asked_again_is_not_worked_out_again():
    times, poses = wandering(60, 1)
    recording = Recording(times, poses, "motor_spline", RADIUS)
    costs, asked, errors = Costs(recording, 8), [], recording.errors
    recording.errors = lambda samples, shown: asked.extend(samples.tolist()) or errors(samples, shown)
    rows = np.array([[-1, 0, 10, 20], [0, 10, 20, 30], [-1, 0, 10, 20], [3, 4, 5, 6]])
    cost, peak = costs.of(rows.reshape(2, 2, 4))
    assert sorted(asked) == [*range(1, 10), *range(11, 20)]
    assert cost[1].tolist() == [cost[0, 0], 0.0]
    assert [found.tolist() for found in costs.of(rows[1])] == [cost[0, 1], peak[0, 1]]
    assert len(asked) == 18


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "motor_spline_causal"])
def test_keys_are_the_same_whatever_is_remembered_or_put_off(mode, monkeypatch):
    times, poses = wandering(200, 7, 0.001)
    keys = reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist()
    monkeypatch.setattr(key_costs, "REMEMBERED", 10)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys
    monkeypatch.setattr(key_search, "MUCH", 0)
    assert reduce_keys(times, poses, mode, TOLERANCE, RADIUS).tolist() == keys


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_some_segments_are_what_they_are_among_all(mode, scaled):
    times, poses, _ = wandering_body(6, 3, 11, scaled=scaled)
    curves, progress = MODES[mode].curves, np.tile((0.2, 0.5, 0.9), 15)
    every = prepare_within(curves, times, poses)(np.full(15, 3), progress, slice(None))
    some = prepare_within(curves, times, poses, slice(1, 3))(np.full(6, 3), progress[:18], slice(None))
    for one, other in zip(_arrays(every), _arrays(some), strict=True):
        chosen = one.reshape(3, 5, 3, -1)[:, 1:3].reshape(18, -1)
        np.testing.assert_allclose(other.reshape(18, -1), chosen, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("scaled", [False, True])
def test_a_joint_is_as_far_off_as_what_hangs_on_it(scaled, monkeypatch):
    monkeypatch.setattr("rigid_motion.motion.skeleton_levels.AT_ONCE", 5)
    times, poses, parents = wandering_body(20, 9, 2, scaled=scaled, noise=0.01)
    random, skeleton = np.random.default_rng(1), Skeleton(parents)
    radii, weights = random.uniform(0.0, 0.1, 9), random.uniform(0.0, 2.0, (9, 20))
    body = Body(times, poses, skeleton, "motor_spline", radii, weights, np.ones(9, dtype=bool))
    keys = np.array((0, 4, 11, 19))
    shown = interpolate(times[keys], poses[:, keys], times, "lerp_slerp")
    for joints in skeleton.levels:
        level, samples = Level(body, joints, shown, 0.5), random.permutation(20 * len(joints))[:15]
        there = Poses(*(None if rows is None else rows.reshape(-1, *rows.shape[2:]) for rows in _arrays(poses[joints])))
        for sample, error in zip(samples.tolist(), level.errors(samples, there[samples]).tolist(), strict=True):
            joint, moment = joints[sample // 20], sample % 20
            tried = shown.copy()
            tried[joint] = poses[joint]
            off = _errors_of(body, tried)[skeleton.below(joint), moment]
            assert error == pytest.approx(off.max() / 0.5, rel=1e-9, abs=1e-12)


def _errors_of(body: Body, shown: Poses) -> np.ndarray:
    """Weighted shell errors (joints, n) where joints go up their own chains."""
    found = np.empty(shown.shape)
    for joint, parent in enumerate(body.skeleton.parents.tolist()):
        there = shown[joint]
        while parent >= 0:
            there, parent = placed(shown[parent], there), int(body.skeleton.parents[parent])
        found[joint] = shell_error(there, body.truth[joint], body.radii[joint]) * body.weights[joint]
    return found


def _arrays(poses: Poses) -> list[np.ndarray]:
    return [rows for rows in (poses.positions, poses.quaternions, poses.scales) if rows is not None]
