"""A sender sends when it must, and what is shown is within the tolerance, between samples as well."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import turned
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import Path
from rigid_motion.streams.wire import read
from tests.thoroughness import combined, tried

from .links import backs_of, body, dance, run

SLACK = 1.02
"""Samples are promised; frames lie between them, where both motions bend a little."""


@pytest.mark.parametrize("delay", [0.1, 0.2])
@pytest.mark.parametrize("rate", [30.0, 60.0, 90.5])
def test_what_is_shown_is_within_the_tolerance(rate: float, delay: float) -> None:
    own = body()
    outcome = run(own, *dance(own, 4.0, rate), delay=delay)
    assert outcome.errors.max() <= 0.005 * SLACK
    assert len(outcome.errors) > 400


def test_every_sample_of_a_window_may_need_a_knot() -> None:
    """As of a tracker that trembles, at a long delay."""
    times, rng = np.arange(240) / 120.0, np.random.default_rng(5)
    places = rng.normal(scale=0.02, size=(1, 240, 3))
    outcome = run(Body.rigid("hand"), times, Poses(places, np.tile((1.0, 0, 0, 0), (1, 240, 1))), delay=0.2)
    assert outcome.errors.max() <= 0.005 * SLACK


def test_messages_of_many_joints_are_as_long_as_they_have_to_be() -> None:
    own = body(60)
    outcome = run(own, *dance(own, 0.8), answers=False)
    assert max(len(datagram) for _, datagram in outcome.datagrams) > 1200
    assert outcome.errors.max() <= 0.005 * SLACK


@pytest.mark.parametrize("gap", [0.0021, 0.0028, 0.0035])
def test_a_jump_between_two_uneven_samples_is_within_the_tolerance(gap: float) -> None:
    """As a tracker's that was lost, at moments that are on no grid."""
    times = np.cumsum(np.random.default_rng(3).uniform(0.0105, 0.0125, 60))
    times[30:] += gap - (times[30] - times[29])
    places = np.where(np.arange(60)[:, None] < 30, 0.0, (0.037, 0.029, 0.02))
    poses = Poses(places[None], np.tile((1.0, 0, 0, 0), (1, 60, 1)))
    outcome = run(Body.rigid("hand"), times, poses, fps=1000.0)
    assert outcome.errors.max() <= 0.005 * SLACK


def swing(rate: float) -> tuple[Body, np.ndarray, Poses]:
    """A hand on a long arm that gets to 22 m/s."""
    times = np.arange(round(3.0 * rate)) / rate
    angles = 1.6 * np.sin(9.0 * times) ** 3
    turns = np.array(turned(np.tile((1.0, 0, 0, 0), (len(times), 1)), angles[:, None] * (0.0, 0.0, 1.0)))
    places = 1.1 * np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1)
    return Body.rigid("hand", radius=0.1), times, Poses(places[None], turns[None])


@pytest.mark.parametrize(("rate", "uneven", "answers"), combined([60.0, 91.0, 120.0], [0.0, 0.001], [True, False]))
def test_a_fast_hand_is_within_the_tolerance_between_samples(rate: float, uneven: float, answers: bool) -> None:
    """Knots lie on a grid, beside uneven samples; one just behind the start of a window is seen by no sample."""
    own, times, poses = swing(rate)
    times = times + np.random.default_rng(int(rate)).uniform(0.0, uneven, len(times))
    outcome = run(own, times, poses, fps=1000.0, answers=answers)
    assert outcome.errors.max() <= 0.005 * SLACK


def test_a_sample_that_is_overdue_is_not_waited_for() -> None:
    own = body()
    times, poses = dance(own, 4.0, 90.0)
    rng = np.random.default_rng(2)
    kept = np.cumsum(rng.integers(1, 7, len(times)))
    kept = kept[kept < len(times)]
    outcome = run(own, times[kept], poses[:, kept])
    assert np.diff(times[kept]).max() > 0.06
    assert outcome.errors.max() <= 0.005 * SLACK


def test_samples_from_before_what_was_sent_without_them_are_said_all_the_same() -> None:
    own, times, poses = swing(60.0)
    sender, receiver, truth, polled, largest = Sender([own]), Receiver(), Path(times, poses), 0, 0.0
    for row, time in enumerate(times.tolist()):
        # What is overdue is sent, and then the sample comes, late.
        datagrams = sender.poll(time + 0.005) if sender.next < time + 0.005 else []
        polled += len(datagrams)
        for datagram in [*datagrams, *sender.add(time, poses[:, row])]:
            receiver.take(datagram, time + 0.005)
        for _, answer in receiver.answers():
            sender.hear(answer, time)
            assert not read(answer).needs
        for shown in receiver.show(time + 0.005).values():
            off = Forest([own]).errors(shown.poses["hand"][:, None], truth.at(np.array([shown.moment])))
            largest = max(largest, float(off.max()))
    assert polled > 5
    assert largest < 0.02


def test_a_body_at_rest_costs_keepalives() -> None:
    own = body()
    times, poses = dance(own, 10.0)
    still = poses[:, np.zeros(len(times), dtype=int)]
    outcome = run(own, times, still)
    late = [datagram for sent, datagram in outcome.datagrams if sent > 1.0]
    assert 9.0 / 0.5 - 2 <= len(late) <= 9.0 / 0.5 + 2
    assert np.ptp(outcome.errors[outcome.now > 5.0]) < 1e-4
    assert max(map(len, late)) <= 12


def test_it_builds_on_what_is_acknowledged() -> None:
    own = body()
    samples = dance(own, 4.0)
    with_answers, without = (run(own, *samples, answers=answers) for answers in (True, False))
    assert set(backs_of(datagram for sent, datagram in with_answers.datagrams if sent > 0.5)) == {1}
    assert max(backs_of(datagram for _, datagram in without.datagrams)) > 1
    assert sum(len(d) for _, d in with_answers.datagrams) < 0.8 * sum(len(d) for _, d in without.datagrams)


def test_finish_says_the_rest() -> None:
    own = body()
    times, poses = dance(own, 1.0)
    said = []
    for stop in range(40, 60):
        sender = Sender([own], rate=60.0)
        for row in range(stop):
            sender.add(float(times[row]), poses[:, row])
        said.append(len(sender.finish()))
        assert sender.finish() == []
    assert set(said) == {0, 1}


@pytest.mark.parametrize("wrong", [{"tolerance": 0.0}, {"delay": float("nan")}, {"keepalive": -1.0}])
def test_numbers_that_are_none_are_refused(wrong: dict) -> None:
    with pytest.raises(ValueError, match="is not a positive number"):
        Sender([body()], **wrong)


def test_poses_that_are_none_are_refused() -> None:
    sender = Sender([body(3)])
    with pytest.raises(ValueError, match="3 finite poses"):
        sender.add(0.0, Poses(np.full((3, 3), np.nan), np.tile((1.0, 0, 0, 0), (3, 1))))


@pytest.mark.parametrize("seed", range(tried(4)))
def test_a_source_that_leaps_and_then_stops_leaves_keepalives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.arange(60) / 120.0 + rng.uniform(0.0, 0.003, 60)
    places = np.cumsum(rng.normal(0.0, 0.2, (60, 3)), axis=0)
    sender = Sender([Body.rigid("hand")], tolerance=0.0005)
    for time, place in zip(times, places, strict=True):
        sender.add(time, Poses(place[None], [[1.0, 0.0, 0.0, 0.0]]))
    said = [len(sender.poll(times[-1] + pause)) for pause in np.arange(0.01, 3.0, 0.01)]
    assert 3 <= sum(said[50:]) < 12


def test_who_joins_gets_the_description_and_a_message_that_builds_on_nothing() -> None:
    own, times, poses = swing(60.0)
    sender, receiver = Sender([own], rate=60.0), Receiver()
    for sample in range(40):
        sender.add(times[sample], poses[:, sample])
    for datagram in [*sender.join(), *sender.add(times[40], poses[:, 40])]:
        receiver.take(datagram, 0.0)
    assert receiver.show(0.1)
