"""Tests of senders: they send only when needed, and the shown motion is within the tolerance, also between samples."""

from __future__ import annotations

import itertools
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import turned
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.bodies import MAX_CLOCK_S, Forest
from rigid_motion.streams.paths import KnotPath
from rigid_motion.streams.sender import GRID_TICKS, MAX_SEQUENCE_NUMBER
from rigid_motion.streams.wire import read
from tests.thoroughness import combined, tried

from .links import BODY, backs_of, body, dance, danced, run

SLACK = 1.02
"""Factor on the tolerance: it is guaranteed at samples, but both motions bend a little at the frames between them."""


@pytest.mark.parametrize("delay", [0.1, 0.2])
@pytest.mark.parametrize("rate", [30.0, 60.0, 90.5])
def test_what_is_shown_is_within_the_tolerance(rate: float, delay: float) -> None:
    outcome = danced(4.0, rate, delay=delay)
    assert outcome.errors.max() <= 0.005 * SLACK
    assert len(outcome.errors) > 350


def test_every_sample_of_a_window_may_need_a_knot() -> None:
    """As from a jittery tracker, at a long delay."""
    times, rng = np.arange(240) / 120.0, np.random.default_rng(5)
    places = rng.normal(scale=0.02, size=(1, 240, 3))
    outcome = run([StreamBody.rigid("hand")], times, Poses(places, np.tile((1.0, 0, 0, 0), (1, 240, 1))), delay=0.2)
    assert outcome.errors.max() <= 0.005 * SLACK


def test_messages_of_many_joints_are_as_long_as_they_have_to_be() -> None:
    own = body(60)
    outcome = run([own], *dance(own, 0.8), answers=False)
    assert max(len(datagram) for _, datagram in outcome.datagrams) > 1200
    assert outcome.errors.max() <= 0.005 * SLACK


@pytest.mark.parametrize("gap", [0.0021, 0.0028, 0.0035])
def test_a_jump_between_two_uneven_samples_is_within_the_tolerance(gap: float) -> None:
    """As from a tracker that was lost, at moments on no grid."""
    times = np.cumsum(np.random.default_rng(3).uniform(0.0105, 0.0125, 60))
    times[30:] += gap - (times[30] - times[29])
    places = np.where(np.arange(60)[:, None] < 30, 0.0, (0.037, 0.029, 0.02))
    poses = Poses(places[None], np.tile((1.0, 0, 0, 0), (1, 60, 1)))
    outcome = run([StreamBody.rigid("hand")], times, poses, fps=1000.0)
    assert outcome.errors.max() <= 0.005 * SLACK


def swing(rate: float) -> tuple[StreamBody, np.ndarray, Poses]:
    """Return a hand on a long arm that reaches 22 m/s."""
    times = np.arange(round(3.0 * rate)) / rate
    angles = 1.6 * np.sin(9.0 * times) ** 3
    turns = np.array(turned(np.tile((1.0, 0, 0, 0), (len(times), 1)), angles[:, None] * (0.0, 0.0, 1.0)))
    places = 1.1 * np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1)
    return StreamBody.rigid("hand", radius=0.1), times, Poses(places[None], turns[None])


@pytest.mark.parametrize(("rate", "uneven", "answers"), combined([60.0, 91.0, 120.0], [0.0, 0.001], [True, False]))
def test_a_fast_hand_is_within_the_tolerance_between_samples(rate: float, uneven: float, answers: bool) -> None:
    """Knots lie on a grid between uneven samples; no sample sees a knot just after the start of a window."""
    own, times, poses = swing(rate)
    times = times + np.random.default_rng(int(rate)).uniform(0.0, uneven, len(times))
    outcome = run([own], times, poses, fps=1000.0, answers=answers)
    assert outcome.errors.max() <= 0.005 * SLACK


def test_a_sample_that_is_overdue_is_not_waited_for() -> None:
    times, poses = dance(BODY, 4.0, 90.0)
    rng = np.random.default_rng(2)
    kept = np.cumsum(rng.integers(1, 7, len(times)))
    kept = kept[kept < len(times)]
    outcome = run([BODY], times[kept], poses[:, kept])
    assert np.diff(times[kept]).max() > 0.06
    assert outcome.errors.max() <= 0.005 * SLACK


def test_samples_from_before_what_was_sent_without_them_are_said_all_the_same() -> None:
    own, times, poses = swing(60.0)
    sender, receiver, truth, polled, largest = Sender([own]), Receiver(), KnotPath(times, poses), 0, 0.0
    for row, time in enumerate(times.tolist()):
        # Overdue motion is sent, and then the sample comes late.
        datagrams = sender.poll(time + 0.005) if sender.next < time + 0.005 else []
        polled += len(datagrams)
        for datagram in [*datagrams, *sender.add(time, poses[:, row])]:
            receiver.take(datagram, time + 0.005)
        for _, answer in receiver.answers():
            sender.take_answer(answer, time)
            assert not read(answer).needs
        for shown in receiver.show(time + 0.005).values():
            off = Forest([own]).errors(shown.poses["hand"][:, None], truth.at(np.array([shown.moment])))
            largest = max(largest, float(off.max()))
    assert polled > 5
    assert largest < 0.02


def test_a_body_at_rest_costs_keepalives() -> None:
    times, poses = dance(BODY, 10.0)
    still = poses[:, np.zeros(len(times), dtype=int)]
    outcome = run([BODY], times, still)
    late = [datagram for sent, datagram in outcome.datagrams if sent > 1.0]
    assert 9.0 / 0.5 - 2 <= len(late) <= 9.0 / 0.5 + 2
    assert np.ptp(outcome.errors[outcome.now > 5.0]) < 1e-4
    assert max(map(len, late)) <= 12


def test_it_builds_on_what_is_acknowledged() -> None:
    with_answers, without = (danced(4.0, answers=answers) for answers in (True, False))
    assert set(backs_of(datagram for sent, datagram in with_answers.datagrams if sent > 0.5)) == {1}
    assert max(backs_of(datagram for _, datagram in without.datagrams)) > 1
    assert sum(len(d) for _, d in with_answers.datagrams) < 0.8 * sum(len(d) for _, d in without.datagrams)


def test_finish_says_the_rest() -> None:
    times, poses = dance(BODY, 1.0)
    said = []
    for stop in range(40, 60):
        sender = Sender([BODY], rate=60.0)
        for row in range(stop):
            sender.add(float(times[row]), poses[:, row])
        said.append(len(sender.finish()))
        assert sender.finish() == []
    assert set(said) == {0, 1}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *itertools.product(["tolerance", "delay", "keepalive"], [0.0, float("nan"), -1.0, 1e5, 1e308]),
        ("tolerance", 1e-7),
        ("delay", 1e-4),
    ],
)
def test_numbers_that_are_none_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"a {name} of .* is not a positive number"):
        Sender([body()], **{name: value})


@pytest.mark.parametrize("rate", [float("nan"), float("inf"), -30.0, 1e-320, 1e-3, 5e-324])
def test_rates_that_are_none_are_no_rates(rate: float) -> None:
    assert Sender([body()], rate=rate).codec.terms.grid == GRID_TICKS


@pytest.mark.parametrize("wrong", [0.0, 1e-9, 1e4, float("nan"), np.ones(2), np.array((0.1, 0.1, 0.0))])
def test_radii_that_are_none_are_refused(wrong: float | np.ndarray) -> None:
    with pytest.raises(ValueError, match="a radius is one for all joints or for each"):
        body(3, wrong)


@pytest.mark.parametrize(("place", "turn"), [(np.nan, 1.0), (-1e4, 1.0), (0.0, 0.0), (0.0, np.inf), (0.0, np.nan)])
def test_poses_that_are_none_are_refused_by_name_and_change_nothing(place: float, turn: float) -> None:
    own = body(3)
    sender, other = Sender([own]), Sender([own])
    positions, quaternions = own.rest.positions.copy(), own.rest.quaternions.copy()
    positions[2, 1], quaternions[2, 0] = place, turn
    with pytest.raises(ValueError, match=r"performer, joint 2: a pose needs a place within 10000 m, and a quaternion"):
        sender.add(0.0, Poses(positions, quaternions))
    with pytest.raises(ValueError, match="performer, joint 2 at rest"):
        StreamBody("performer", own.joints, own.parents, Poses(positions, quaternions))
    other.identity = sender.identity
    assert sender.add(0.0, own.rest) == other.add(0.0, own.rest)


@pytest.mark.parametrize(("way", "answers"), combined([(2600.0, 0.005), (5.0, 1e-5), (9999.0, 1e-6)], [True, False]))
def test_as_far_as_poses_may_be_all_is_within_the_tolerance(way: tuple[float, float], answers: bool) -> None:
    """There and back in two seconds, and then within a sample; floats have 16 digits."""
    own, (away, tolerance) = body(4), way
    times, poses = dance(own, 3.0)
    share = np.where(times < 2.0, np.sin(0.5 * np.pi * times), 1.0 - times * 10.0 // 2 % 2)
    poses.positions[0] = share[:, None] * (away, -away, 0.5 * away)
    outcome = run([own], times, poses, tolerance=tolerance, answers=answers)
    assert outcome.between(1.1, 3.0).max() <= tolerance * SLACK + 1e-9


NUMBERS = st.floats() | st.sampled_from([0.0, 1.0, 5e-324, 1e-310, -1e-200, 1e200, 9999.0, -9999.0])


@settings(max_examples=tried(60))
@given(
    st.lists(st.tuples(st.just(None) | NUMBERS, st.lists(NUMBERS, min_size=14, max_size=14)), max_size=6), st.booleans()
)
def test_whatever_numbers_poses_and_times_are_a_sender_goes_on(samples: list, answers: bool) -> None:
    """Samples that the sender accepts are shown within the tolerance once motion is still; it reports the others."""
    bodies, calm = (
        [StreamBody.rigid("hand"), StreamBody.rigid("tool", radius=1.0)],
        Poses([[0.5] * 3] * 2, [[0.5] * 4] * 2),
    )
    sender, receiver = Sender(bodies), Receiver()

    def say(datagrams: list[bytes], now: float) -> None:
        for datagram in datagrams:
            receiver.take(datagram, now)
        for _, answer in receiver.answers() if answers else ():
            sender.take_answer(answer, now)

    numbers = [(time, np.array(row).reshape(2, 7)) for time, row in samples]
    clock = 0.0
    for row, (time, pose) in enumerate(numbers):
        clock = row / 60.0 if time is None else time
        sound = (np.abs(pose[:, :3]) < 1e4).all() and np.isfinite(pose).all() and pose[:, 3:].any(axis=1).all()
        with nullcontext() if sound and abs(clock) <= MAX_CLOCK_S else pytest.raises(ValueError, match="needs"):
            say(sender.add(clock, Poses(pose[:, :3], pose[:, 3:])), row / 60.0)
        say(sender.poll(sender.next), row / 60.0)
    # A clock that is set by small steps again and again is followed for a while.
    for row in range(len(numbers), len(numbers) + 300):
        say(sender.add(row / 60.0, calm), row / 60.0)
        for shown in receiver.show(row / 60.0).values():
            assert all(np.isfinite(own.positions).all() for own in shown.poses.values())
    shown = np.concatenate([own.positions for own in shown.poses.values()])
    assert np.abs(shown - 0.5).max() <= 0.005


@pytest.mark.parametrize("seed", range(tried(2)))
def test_a_source_that_leaps_and_then_stops_leaves_keepalives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.arange(60) / 120.0 + rng.uniform(0.0, 0.003, 60)
    places = np.cumsum(rng.normal(0.0, 0.2, (60, 3)), axis=0)
    sender = Sender([StreamBody.rigid("hand")], tolerance=0.0005)
    for time, place in zip(times, places, strict=True):
        sender.add(time, Poses(place[None], [[1.0, 0.0, 0.0, 0.0]]))
    said = [len(sender.poll(times[-1] + pause)) for pause in np.arange(0.01, 3.0, 0.01)]
    assert 3 <= sum(said[50:]) < 12


def test_behind_the_last_sequence_it_begins_again_without_a_sample_too() -> None:
    own = body(3)
    sender = Sender([own])
    before = {read(datagram).identity for datagram in sender.add(0.0, own.rest)}
    sender._sequence = MAX_SEQUENCE_NUMBER + 1
    said = [read(datagram) for datagram in sender.poll(0.9)]
    assert [type(datagram).__name__ for datagram in said] == ["Description", "EncodedMotion"]
    assert not before & {datagram.identity for datagram in said}


def test_who_joins_gets_the_description_and_a_message_that_builds_on_nothing() -> None:
    own, times, poses = swing(60.0)
    sender, receiver = Sender([own], rate=60.0), Receiver()
    for sample in range(40):
        sender.add(times[sample], poses[:, sample])
    for datagram in [*sender.join(), *sender.add(times[40], poses[:, 40])]:
        receiver.take(datagram, 0.0)
    assert receiver.show(0.1)
