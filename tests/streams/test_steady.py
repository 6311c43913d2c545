"""Tests of steady streams: nearer to the truth than One Euro at equal delay, no later, harmless without jitter."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses, clean, interpolate, repair, shell_error
from rigid_motion.motion.quaternions import turned
from rigid_motion.streams import Receiver, Sender, StreamBody, vmc
from rigid_motion.streams.paths import KnotPath as Knots
from rigid_motion.streams.steady import MIN_KEY_GAP_S, MIN_SAMPLES, Steady
from rigid_motion_batch.recordings import read_trajectories
from tests.streams.one_euro import one_euro
from tests.thoroughness import THOROUGH

ASSETS = Path(__file__).resolve().parents[2] / "assets"
CLIPS = ("hold", "pivot", "reach", "screw", "throw") if THOROUGH else ("pivot", "throw")
RATE, DELAY, RADIUS = 60.0, 0.05, 0.1
SIZE, TURN = 0.001, np.radians(0.3)
KNOWN = 2.0
"""Seconds after which the amount of jitter is known."""


def recorded(name: str) -> tuple[np.ndarray, Poses]:
    """Return a clip at `RATE` frames per second without its device's noise, to serve as truth."""
    trajectory = read_trajectories(str(ASSETS / f"{name}.csv")).trajectories[0]
    times, poses, _ = repair(trajectory.times, trajectory.poses)
    even = np.arange(times[0], times[-1], 1.0 / RATE)
    return even, clean(even, interpolate(times, poses, even, "lerp_slerp")).poses


def shaken(truth: Poses) -> Poses:
    random, shape = np.random.default_rng(3), truth.positions.shape
    turns = TURN * random.normal(size=shape)
    return Poses(truth.positions + SIZE * random.normal(size=shape), turned(truth.quaternions, turns))


def shown(times: np.ndarray, poses: Poses) -> tuple[np.ndarray, Poses]:
    """Return the moments shown as each sample comes, and the poses shown then."""
    steady, moments, result = Steady(), times[MIN_SAMPLES:] - DELAY, []
    one = Poses(poses.positions[None], poses.quaternions[None])
    for last, moment in enumerate(moments.tolist(), MIN_SAMPLES):
        first = max(int(np.searchsorted(times, moment, side="right")) - 1, 0)
        knots = slice(first, last + 1)
        result.append(steady(Knots(times[knots], one[:, knots]), moment, np.inf)[0])
    return moments, Poses(np.array([one.positions for one in result]), np.array([one.quaternions for one in result]))


def rms(poses: Poses, truth: Poses, moments: np.ndarray) -> float:
    return float(np.sqrt(np.mean(shell_error(poses, truth, RADIUS)[moments > moments[0] + KNOWN] ** 2)))


@pytest.mark.parametrize("name", CLIPS)
def test_it_is_nearer_to_the_truth_than_one_euro_tuned_to_each_clip_at_the_same_delay(name):
    times, truth = recorded(name)
    poses = shaken(truth)
    moments, steady = shown(times, poses)
    there = interpolate(times, truth, moments, "motor_spline")
    as_it_came = rms(interpolate(times, poses, moments, "lerp_slerp"), there, moments)
    # One Euro may be shown with the same delay, or earlier to make up for its own lag.
    tuned = min(
        rms(interpolate(times, filtered, moments + late, "lerp_slerp"), there, moments)
        for least in (1.0, 2.0, 4.0, 8.0, 12.0, 20.0)
        for beta in (0.0, 1.0, 3.0, 10.0, 30.0)
        for filtered in (one_euro(times, poses, least, beta),)
        for late in np.linspace(0.0, DELAY, 6)
    )
    assert rms(steady, there, moments) < 0.8 * tuned
    assert rms(steady, there, moments) < 0.6 * as_it_came


def test_without_noise_and_with_few_keys_it_is_what_came():
    times = np.arange(0.0, 8.0, 1.0 / RATE)
    places = np.stack((np.sin(3.0 * times), np.cos(2.0 * times), 0.2 * times), axis=1)
    truth = Poses(places, turned(np.tile((1.0, 0.0, 0.0, 0.0), (len(times), 1)), places[:, ::-1]))
    moments, steady = shown(times, truth)
    as_it_came = interpolate(times, truth, moments, "lerp_slerp")
    assert shell_error(steady, as_it_came, RADIUS).max() < 1e-3 * SIZE
    few = slice(None, None, int(RATE * MIN_KEY_GAP_S) + 1)
    moments, steady = shown(times[few], shaken(truth)[few])
    as_it_came = interpolate(times[few], shaken(truth)[few], moments, "lerp_slerp")
    assert shell_error(steady, as_it_came, RADIUS).max() < 1e-9


def test_a_step_and_a_hit_stay_as_sharp_as_they_came():
    times = np.arange(0.0, 12.0, 1.0 / RATE)
    heights = 0.3 * (times > 6.0) + 0.2 * np.abs(np.sin(np.pi * times)) * (times < 5.0)
    truth = Poses(heights[:, None] * (0.0, 0.0, 1.0), np.tile((1.0, 0.0, 0.0, 0.0), (len(times), 1)))
    poses = shaken(truth)
    moments, steady = shown(times, poses)
    there = interpolate(times, truth, moments, "lerp_slerp")
    as_it_came = interpolate(times, poses, moments, "lerp_slerp")
    hits = (np.abs(moments[:, None] - [3.0, 4.0, 6.0]) < 1.5 / RATE).any(axis=1)
    errors = [np.sqrt(np.mean(shell_error(poses, there, RADIUS)[hits] ** 2)) for poses in (steady, as_it_came)]
    assert errors[0] < 1.1 * errors[1]


@pytest.mark.parametrize("by_vmc", [True, False])
def test_by_vmc_and_where_a_stream_sends_every_sample_it_jitters_less_at_the_same_moments(by_vmc):
    times, truth = recorded("reach" if by_vmc else "pivot")
    sender = Sender([StreamBody.rigid("tool")], 0.0005, DELAY, RATE, 0.9 / RATE)
    receivers, errors = [Receiver(DELAY, steady=steady) for steady in (False, True)], []
    for time, pose in zip(times.tolist(), shaken(truth), strict=True):
        if by_vmc:
            datagrams = [*vmc.write_trackers({"tool": pose}), *vmc.write(time, {})]
        else:
            datagrams = sender.add(time, Poses(pose.positions[None], pose.quaternions[None]))
        for datagram, receiver in itertools.product([*([] if errors else sender.join()), *datagrams], receivers):
            receiver.take(datagram, time)
        shown = [what for receiver in receivers for what in receiver.show(time).values()]
        if shown and shown[0].moment > times[0] + KNOWN:
            there = interpolate(times, truth, np.array([shown[0].moment]), "motor_spline")
            assert shown[0].moment == shown[1].moment
            errors.append([shell_error(what.poses["tool"], there, RADIUS)[0] for what in shown])
    as_it_came, steady = np.sqrt(np.mean(np.square(errors), axis=0))
    assert len(errors) > 100
    assert steady < 0.6 * as_it_came


def test_whatever_comes_it_goes_on():
    random, receiver = np.random.default_rng(1), Receiver(DELAY, steady=True)
    now = 0.0
    for number in range(600):
        now += float(random.choice([1e-5, 0.01, 0.02, 0.5], p=[0.1, 0.6, 0.2, 0.1]))
        turns = random.normal(size=4)
        far = 10.0 ** random.integers(-8, 6)
        pose = Poses(far * random.normal(size=3), turns / np.linalg.norm(turns))
        names = ["a", "b", "c"][: 1 + number // 200]
        for datagram in (*vmc.write_trackers(dict.fromkeys(names, pose)), *vmc.write(now, {})):
            receiver.take(datagram, now)
        for what in receiver.show(now).values():
            assert all(np.isfinite(poses.positions).all() for poses in what.poses.values())
            assert all(np.isfinite(poses.quaternions).all() for poses in what.poses.values())
