"""A link delays, loses and reorders as it says, and the same way for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper.streaming import Link, send
from tests.scripts.research.paper.streaming.motions import swinging

COUNT = 20_000
SENT = np.arange(COUNT) * 0.05
SIZES = np.full(COUNT, 68)


def arrivals(seed: int = 0, **way: float) -> np.ndarray:
    return Link(**way).arrivals(SENT, SIZES, np.random.default_rng(seed))


def test_a_perfect_link_takes_its_latency():
    assert np.array_equal(arrivals(), SENT)
    assert arrivals(latency=0.05) == pytest.approx(SENT + 0.05)


def test_the_same_seed_is_the_same_link():
    way = {"latency": 0.05, "jitter": 0.1, "loss": 0.2, "rate_limit": 5000.0}
    assert np.array_equal(arrivals(3, **way), arrivals(3, **way))
    assert not np.array_equal(arrivals(3, **way), arrivals(4, **way))


def test_jitter_is_exponential_with_the_mean_that_is_given():
    waits = arrivals(jitter=0.1) - SENT
    assert waits.min() >= -1e-9
    assert waits.mean() == pytest.approx(0.1, rel=0.03)
    assert np.mean(waits < 0.1 * np.log(2.0)) == pytest.approx(0.5, abs=0.015)
    assert np.mean(waits > 0.3) == pytest.approx(np.exp(-3.0), rel=0.1)


@pytest.mark.parametrize("jitter", [0.0, 0.005, 0.05, 0.1])
def test_packets_overtake_one_another_as_often_as_two_exponential_times_say(jitter):
    overtaken = np.mean(np.diff(arrivals(jitter=jitter)) < 0.0)
    assert overtaken == pytest.approx(0.5 * np.exp(-0.05 / jitter) if jitter else 0.0, abs=0.01)


def test_lost_packets_never_arrive():
    lost = np.isinf(arrivals(loss=0.2))
    assert lost.mean() == pytest.approx(0.2, abs=0.01)
    # Each by itself: one that was lost says nothing of the next.
    assert lost[1:][lost[:-1]].mean() == pytest.approx(0.2, abs=0.02)
    assert np.isinf(arrivals(loss=1.0)).all()
    assert np.isfinite(arrivals(loss=0.0)).all()


def test_a_line_with_room_adds_the_time_of_the_bytes():
    assert arrivals(rate_limit=68 / 0.01) == pytest.approx(SENT + 0.01)


def test_a_line_without_room_lets_the_queue_grow():
    assert arrivals(rate_limit=68 / 0.1) == pytest.approx(0.1 * (1.0 + np.arange(COUNT)))


def test_a_burst_waits_for_the_line_and_then_the_line_is_free_again():
    sent, sizes = [0.0, 0.0, 0.0, 10.0], [100, 200, 100, 100]
    found = Link(latency=0.5, rate_limit=100.0).arrivals(sent, sizes, np.random.default_rng(0))
    assert found == pytest.approx([1.5, 3.5, 4.5, 11.5])


def test_what_is_lost_was_on_the_line():
    random = np.random.default_rng(0)
    found = Link(loss=0.5, rate_limit=68 / 0.1).arrivals(SENT, SIZES, random)
    there = np.isfinite(found)
    assert found[there] == pytest.approx(0.1 * (1.0 + np.arange(COUNT)[there]))


def test_headers_take_room_on_the_line():
    packets = send(*swinging(), 20.0)
    found = Link(rate_limit=(26 + 56) / 0.01).carry(packets, np.random.default_rng(0))
    assert found == pytest.approx(packets.stamps + 0.01)


def test_no_packets_have_no_arrivals():
    assert Link(rate_limit=100.0).carry(send(*swinging(), 20.0)[:0], np.random.default_rng(0)).shape == (0,)


@pytest.mark.parametrize(
    ("way", "complaint"),
    [
        ({"latency": -0.1}, "a latency of -0.1"),
        ({"latency": np.inf}, "a latency of inf"),
        ({"jitter": np.nan}, "a jitter of nan"),
        ({"loss": 1.5}, "a loss of 1.5"),
        ({"loss": np.nan}, "a loss of nan"),
        ({"rate_limit": 0.0}, "a rate limit of 0.0"),
    ],
)
def test_links_that_cannot_be_are_refused(way, complaint):
    with pytest.raises(ValueError, match=complaint):
        Link(**way)
