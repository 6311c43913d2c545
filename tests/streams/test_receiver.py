"""Tests of what a receiver shows under any behaviour of the network."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.playing import MOST_JOINT_KNOTS
from tests.thoroughness import combined, tried

from .links import BODY, body, dance, danced, run, talk

TOLERANCE = 0.0051


@pytest.mark.parametrize(("joins", "answers"), combined(np.arange(0.3, 2.5, 0.37).round(2), [True, False]))
def test_somebody_who_joins_is_soon_shown_the_motion(joins: float, answers: bool) -> None:
    outcome = danced(joins + 2.0, heard_from=joins, answers=answers)
    # Unheard within a refresh, and from its first knot on the delay.
    assert outcome.now[0] < joins + (0.3 if answers else 1.0 + 0.02 + 0.1)
    assert outcome.errors.max() <= TOLERANCE


@pytest.mark.parametrize(("latencies", "answers"), combined([(0.05, 0.35), (0.35, 0.05), (0.02, 0.08)], [True, False]))
def test_latency_that_changes_for_good(latencies: tuple[float, float], answers: bool) -> None:
    before, after = latencies
    outcome = danced(6.0, latency=lambda now: before if now < 3.0 else after, answers=answers)
    changed = 3.0 + max(before, after)
    assert outcome.between(0.0, 3.0).max() <= TOLERANCE
    assert outcome.between(changed + 1.0, 6.0).max() <= TOLERANCE
    assert np.diff(outcome.moments).min() >= 0.0
    # A second later the shown motion is as fresh as the network allows.
    late = outcome.now > changed + 1.0
    assert (outcome.now - outcome.moments)[late].max() < after + 0.1 + 0.02
    # No picture leaps: not much faster than the body itself ever is.
    usual = outcome.steps[outcome.now[1:] < 3.0].max()
    assert outcome.steps.max() < 3.0 * usual


@pytest.mark.parametrize(
    ("whose", "step"),
    [
        *itertools.product(["the receiver's"], [5.0, -5.0]),
        *itertools.product(["the sender's", "the sender's unheard"], [5.0, -5.0, -0.7]),
    ],
)
def test_a_clock_that_steps_is_no_motion(whose: str, step: float) -> None:
    if whose == "the receiver's":
        outcome = danced(4.0, clock=lambda now: now + 1000.0 + step * (now > 2.004))
        assert (outcome.now - outcome.moments)[outcome.now > 3.0].max() < 0.13
    else:
        heard = whose == "the sender's"
        outcome = danced(4.0, set_by=lambda now: step * (now > 2.008), answers=heard)
    assert outcome.errors.max() <= TOLERANCE
    assert np.diff(outcome.moments).min() >= 0.0


@pytest.mark.parametrize(("step", "answers"), combined([0.3, 0.5, 0.9, -0.5], [True, False]))
def test_a_sender_s_clock_that_is_set_by_less_than_a_second_is_soon_known(step: float, answers: bool) -> None:
    outcome = danced(4.0, set_by=lambda now: step * (now > 2.008), answers=answers, lag=0.12)
    # A picture or two may be off by what the motion does between two samples.
    off = outcome.between(1.0, 4.0)
    assert np.count_nonzero(off > 4.0 * TOLERANCE) <= 2
    assert off.max() < 0.06
    assert np.diff(outcome.moments).min() >= 0.0


@pytest.mark.parametrize(("bursts", "answers"), combined([0.1, 0.25], [True, False]))
def test_a_receiver_with_a_busy_processor(bursts: float, answers: bool) -> None:

    def drained(now: float) -> float:
        return np.ceil(now / bursts) * bursts if now > 3.0 else now

    outcome = danced(8.0, drained=drained, answers=answers)
    assert outcome.between(0.0, 3.0).max() <= TOLERANCE
    adapted = outcome.between(4.0 + bursts, 8.0)
    # A datagram may still have waited longer than all before.
    assert np.mean(adapted <= TOLERANCE) > 0.98
    assert adapted.max() <= 0.02
    assert np.diff(outcome.moments).min() >= 0.0
    assert (outcome.now - outcome.moments)[outcome.now > 4.5].max() < 0.1 + 0.02 + bursts + 0.02


@pytest.mark.parametrize(("number", "answers"), combined([1, 2, 3, *range(4, 24, 4)], [True, False]))
def test_a_datagram_that_is_lost_costs_no_later_one_its_meaning(number: int, answers: bool) -> None:
    own = body(8)
    sent: list[float] = []

    def lost(now: float, count: int) -> bool:
        if count == number:
            sent.append(now)
        return count == number

    outcome = run([own], *dance(own, 4.0), lost=lost, answers=answers)
    assert outcome.now[0] < (0.3 if answers else 1.1 + 0.1)
    assert outcome.between(sent[0] + 0.5, 4.0).max() <= TOLERANCE


@pytest.mark.parametrize(
    ("limits", "answers"), combined([(0.0, 1.0), (0.01, 0.98), (0.05, 0.93), (0.2, 0.6)], [True, False])
)
def test_a_long_way_with_jitter_loss_and_duplicates(limits: tuple[float, float], answers: bool) -> None:
    loss, within = limits
    copies = 1 + (loss > 0.0)
    outcome = danced(8.0, loss=loss, latency=0.21, jitter=0.08, copies=copies, answers=answers)
    assert np.mean(outcome.between(2.0, 8.0) <= 0.02) >= within
    # No freeze, and no jump back.
    assert np.diff(outcome.moments).min() > 0.0


@pytest.mark.parametrize("seed", range(tried(8)))
@pytest.mark.parametrize("loss", [0.05, 0.2])
def test_where_datagrams_are_lost_no_hand_goes_back_against_its_motion(loss: float, seed: int) -> None:
    own = StreamBody.rigid("hand")
    outcome = run([own], *dance(own, 8.0, speed=4.0, seed=seed), loss=loss, latency=0.21, jitter=0.08, seed=seed)
    # Half a centimetre in one picture is a jump; corrections of what was never sent are gentler.
    assert outcome.turned_back[outcome.now[2:] > 2.0].max() < 0.005


@pytest.mark.parametrize(("loss", "answers"), combined([0.0, 0.01], [True, False]))
def test_an_outage_of_2_s_heals_within_half_a_second(loss: float, answers: bool) -> None:
    outcome = danced(7.0, loss=loss, lost=lambda now, count: 2.0 <= now < 4.0, latency=0.03, answers=answers)
    there = np.concatenate((outcome.between(0.0, 2.0), outcome.between(4.5, 7.0)))
    assert np.mean(there <= 0.02) >= 0.98
    assert outcome.between(4.5, 5.0).max() <= (TOLERANCE if not loss else 0.02)
    # No freeze, and no jump back.
    assert np.diff(outcome.moments).min() > 0.0
    assert (outcome.now - outcome.moments)[outcome.now > 4.5].max() < 0.1 + 0.03 + 0.02


def test_where_much_is_lost_everything_is_sent_twice() -> None:
    own, rng = body(3), np.random.default_rng(2)
    outcome = run([own], *dance(own, 16.0), lost=lambda now, count: now < 4.0 and rng.random() < 0.2)
    sent = {True: [], False: []}
    for now, datagram in outcome.datagrams:
        if 1.0 < now < 4.0 or now > 13.0:
            sent[now < 4.0].append(datagram)
    assert len(sent[True]) > 1.5 * len(set(sent[True]))
    assert len(sent[False]) == len(set(sent[False]))


def test_a_sender_that_begins_again_is_told_by_its_identity_and_replays_of_the_one_before_change_nothing() -> None:
    times, poses = dance(BODY, 4.0)
    receiver, old = Receiver(), []
    first, sender = Sender([BODY], rate=60.0), Sender([BODY], rate=60.0)
    for row, time in enumerate(times.tolist()):
        # The second sender begins with its own times.
        datagrams = first.add(time, poses[:, row]) if time < 2.0 else sender.add(time - 2.0, poses[:, row])
        old += datagrams if time < 2.0 else []
        for datagram in datagrams:
            receiver.take(datagram, time, "somebody")
        if time > 3.0:
            receiver.take(old[row % len(old)], time, "somebody")
        shown = receiver.show(time)
        if time > 2.2:
            assert [stream.identity for stream in shown] == [sender.identity]
    assert [1.8 < one.moment < 2.0 for one in shown.values()] == [True]


@pytest.mark.slow
def test_keys_that_nobody_records_are_forgotten() -> None:
    own = StreamBody.rigid("hand")
    times, poses = dance(own, 60.0, speed=8.0)
    sender, receiver = Sender([own], 0.001, rate=60.0), Receiver()
    for row, time in enumerate(times.tolist()):
        talk(sender, receiver, time, poses[:, row], answers=False)
    (keys,) = receiver.keys()
    assert 500 < len(keys.moments) <= MOST_JOINT_KNOTS
