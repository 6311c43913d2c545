"""A receiver that forgets all but the last seconds shows what one shows that knows all of the run."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES
from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.streaming import PACKINGS, TWISTS, Link, Packets, Playback, PlayOut, What, receive, send
from rigid_motion_batch.streaming.live import MOST_PACKETS, LiveReceiver
from rigid_motion_batch.streaming.packets import HEADER, sealed
from rigid_motion_batch.streaming.wire import Terms, beat, changed
from tests.scripts.streaming.motions import swinging
from tests.thoroughness import THOROUGH, sample, tried

FPS = 72.0

LATENCY = 0.0517
"""With which nothing arrives at the very moment of a frame."""

BAD = Link(latency=LATENCY, jitter=0.1, loss=0.2)

MODES_OF_STREAMS = (*MODES, TWISTS)


def packets_of(seed: int, seconds: float, mode: str = "dq_sclerp", rate: float = 20.0) -> Packets:
    """A motion as a stream has it, with twists where its mode takes some."""
    times, poses = swinging(seed, seconds)
    if mode != TWISTS:
        return send(times, poses, rate)
    rows = np.unique(np.random.default_rng(seed).integers(0, len(times), round(seconds * rate / 2)))
    twists = np.random.default_rng(seed).normal(size=(len(rows), 6))
    return Packets.of(times[rows], poses[rows], 1.0 / rate, PACKINGS["double"], twists=twists, stream=7)


def terms_of(packets: Packets, mode: str, wait: float = 2.0, **play_out: float) -> Terms:
    return Terms.of(mode, packets.interval, PlayOut(wait=wait, **play_out))


def play(
    receiver: LiveReceiver, arrivals: list[tuple[float, bytes]], until: float, step: float = 0.25
) -> tuple[list[Playback], int]:
    """All that a receiver shows of datagrams that arrive at these times, and the most packets that it remembered."""
    parts, most, now = [], 0, step
    for moment, datagram in sorted(arrivals, key=lambda arrival: arrival[0]):
        if moment > until:
            break
        while moment > now:
            parts.append(receiver.show(now))
            now += step
        receiver.accept(datagram, moment)
        most = max(most, receiver.remembered)
    return [*parts, receiver.finish(until)], most


def first_of_each(arrivals: list[tuple[float, bytes]], size: int) -> tuple[np.ndarray, np.ndarray]:
    """The keys that come, each when it first does, by itself or in a heartbeat: their bytes, and when."""
    came: dict[int, tuple[float, bytes]] = {}
    for moment, datagram in sorted(arrivals, key=lambda arrival: arrival[0]):
        sequence = int(np.frombuffer(datagram, HEADER, 1)["sequence"][0])
        came.setdefault(sequence, (moment, changed(datagram[:size], kind=1)))
    data = np.frombuffer(b"".join(datagram for _, datagram in came.values()), np.uint8).reshape(-1, size)
    return data, np.array([moment for moment, _ in came.values()])


def assert_same(parts: list[Playback], whole: Playback, tolerance: float = 1e-9) -> None:
    times = np.concatenate([part.times for part in parts])
    assert times == pytest.approx(whole.times, abs=1e-12)
    positions = np.concatenate([part.poses.positions for part in parts])
    quaternions = np.concatenate([part.poses.quaternions for part in parts])
    assert np.abs(positions - whole.poses.positions).max() <= tolerance
    assert angle_between(quaternions, whole.poses.quaternions).max() <= tolerance
    assert np.einsum("ki,ki->k", quaternions[1:], quaternions[:-1]).min() > 0.0
    assert np.array_equal(np.concatenate([part.ran_out for part in parts]), whole.ran_out)


def counts(parts: list[Playback]) -> dict[What, int]:
    return {what: sum(part.counts[what] for part in parts) for what in What}


def run(
    seed: int,
    mode: str,
    link: Link,
    seconds: float = 9.0,
    *,
    beats: bool = True,
    again: float = 0.0,
    step: float = 0.25,
    **play_out: float,
) -> tuple[list[Playback], Playback, int]:
    """What a live receiver shows of a stream over a link, what `receive` does, and the most that was remembered."""
    random = np.random.default_rng(seed)
    packets = packets_of(seed, seconds, mode)
    terms = terms_of(packets, mode, **play_out)
    keys = [row.tobytes() for row in packets.data]
    moments = np.arange(packets.stamps[0] + 0.5, packets.stamps[-1], 0.5) if beats else np.empty(0)
    newest = np.searchsorted(packets.stamps, moments, side="right") - 1
    sent = [
        (float(packets.stamps[0]), beat(keys[0], terms, 0.0)),
        *zip(packets.stamps[1:].tolist(), keys[1:], strict=True),
    ]
    sent += [
        (moment, beat(keys[key], terms, moment - packets.stamps[key]))
        for moment, key in zip(moments.tolist(), newest.tolist(), strict=True)
    ]
    arrivals = link.arrivals([moment for moment, _ in sent], [1] * len(sent), random)
    arrivals[0] = packets.stamps[0] + link.latency
    # Nothing of a stream is known before its terms are.
    arrivals = np.where(arrivals < arrivals[0], np.inf, arrivals)
    came = [(moment, datagram) for moment, (_, datagram) in zip(arrivals.tolist(), sent, strict=True) if moment < 1e9]
    twice = [(moment + random.exponential(0.2), datagram) for moment, datagram in came if random.random() < again]
    until = seconds + 1.0
    parts, most = play(LiveReceiver(FPS), came + twice, until, step)
    data, first = first_of_each(came, packets.data.shape[1])
    display = np.arange(0, int(until * FPS) + 1) / FPS
    reference = Packets(data, packets.packing, terms.interval, packets.twisted)
    whole = receive(reference, first, display, mode, terms.play_out(link.latency))
    return parts, whole, most


@settings(max_examples=tried(160))
@given(
    mode=st.sampled_from(MODES_OF_STREAMS),
    seed=st.integers(0, 10_000),
    loss=st.sampled_from([0.0, 0.05, 0.2, 0.6]),
    jitter=st.sampled_from([0.0, 0.01, 0.1, 0.5]),
    again=st.sampled_from([0.0, 0.3]),
    step=st.sampled_from([0.2, 0.25, 0.7]),
    wait=st.sampled_from([0.5, 2.0, 5.0]),
)
def test_what_is_shown_is_what_one_call_for_all_of_the_run_shows(mode, seed, loss, jitter, again, step, wait):
    link = Link(latency=LATENCY, jitter=jitter, loss=loss)
    parts, whole, _ = run(seed, mode, link, 10.0, again=again, step=step, wait=wait)
    assert_same(parts, whole)


@pytest.mark.parametrize("mode", MODES_OF_STREAMS)
def test_of_a_long_run_only_the_last_seconds_are_remembered(mode):
    parts, whole, most = run(3, mode, BAD, 60.0 if THOROUGH else 12.0, wait=3.0)
    assert_same(parts, whole)
    assert most < 5.0 * 20.0


@pytest.mark.parametrize("mode", sample(MODES_OF_STREAMS))
def test_the_events_are_those_of_one_call_for_all_of_the_run(mode):
    parts, whole, _ = run(5, mode, BAD)
    assert counts(parts) == whole.counts
    assert whole.counts[What.LOST] > 0
    assert whole.counts[What.DUPLICATE] == 0


def test_longer_fades_are_remembered_longer():
    assert_same(*run(4, "dq_sclerp", BAD, 12.0, fade=80.0)[:2])


# Heartbeats


def still(mode: str = "dq_sclerp") -> tuple[bytes, bytes, Terms]:
    """The first two keys of a stream, and its terms."""
    packets = packets_of(0, 1.0, mode)
    first, second = (row.tobytes() for row in packets.data[:2])
    return first, second, terms_of(packets, mode)


def test_a_heartbeat_of_a_still_hand_is_no_duplicate_and_changes_nothing():
    first, _, terms = still()
    receiver = LiveReceiver(FPS)
    parts = []
    for beats in range(100):
        assert receiver.accept(beat(first, terms, 0.5 * beats), 0.5 * beats + 0.05)
        parts.append(receiver.show(0.5 * beats + 0.4))
    parts.append(receiver.finish(50.0))
    assert (receiver.updates, receiver.heartbeats) == (1, 99)
    assert counts(parts)[What.DUPLICATE] == 0
    assert np.ptp(np.concatenate([part.poses.positions for part in parts]), axis=0).max() == 0.0
    assert receiver.remembered == 1


def test_a_heartbeat_brings_a_key_that_was_lost_and_the_key_itself_is_no_duplicate_then():
    first, second, terms = still()
    receiver = LiveReceiver(FPS)
    receiver.accept(beat(first, terms, 0.0), 0.05)
    receiver.accept(beat(second, terms, 0.01), 0.11)
    receiver.accept(second, 0.12)
    assert (receiver.updates, receiver.heartbeats) == (2, 0)
    assert receiver.finish(2.0).counts[What.DUPLICATE] == 0


def test_without_the_terms_nothing_is_shown_and_from_then_on_at_once():
    first, second, terms = still()
    receiver = LiveReceiver(FPS)
    assert not receiver.accept(first, 0.05)
    assert len(receiver.show(1.0).times) == 0
    assert receiver.accept(beat(second, terms, 7.0), 1.05)
    shown = receiver.show(1.1)
    assert shown.times[0] == pytest.approx(1.05, abs=1.0 / FPS)
    # What the link took is reckoned from the heartbeat's age, whatever that of the key was.
    assert receiver.delay == pytest.approx(1.05 - (1.0 / 20.0 + 7.0) + terms.delay)


def test_what_is_of_another_stream_or_of_other_terms_is_not_taken():
    first, second, terms = still()
    receiver = LiveReceiver(FPS)
    receiver.accept(beat(first, terms, 0.0), 0.05)
    assert not receiver.accept(changed(second, stream=99), 0.1)
    other = Terms.of("lerp_slerp", terms.interval, PlayOut(wait=2.0))
    assert not receiver.accept(beat(second, other, 0.0), 0.1)
    assert not receiver.accept(second[:-1], 0.1)
    assert receiver.accept(second, 0.1)


def test_with_a_margin_packets_are_known_when_their_sender_counts_on_it_and_not_sooner():
    packets = packets_of(2, 6.0, TWISTS)
    terms = terms_of(packets, TWISTS)
    keys = [row.tobytes() for row in packets.data]
    late = np.random.default_rng(2).uniform(0.0, 0.3, len(keys))
    late[0] = 0.0
    sent = [beat(keys[0], terms, 0.0), *keys[1:]]
    arrivals = [(stamp + wait, key) for stamp, wait, key in zip(packets.stamps.tolist(), late, sent, strict=True)]
    parts, _ = play(LiveReceiver(FPS, margin=0.3), arrivals, 7.0)
    display = np.concatenate([part.times for part in parts])
    reference = Packets(packets.data, packets.packing, terms.interval, packets.twisted)
    steady = receive(reference, packets.stamps + 0.3, display, TWISTS, terms.play_out(0.3))
    positions = np.concatenate([part.poses.positions for part in parts])[-len(steady.times) :]
    assert np.abs(positions - steady.poses.positions).max() < 1e-9


# Bounds


def test_a_laptop_that_slept_shows_the_frames_it_missed_and_goes_on():
    first, second, terms = still()
    receiver = LiveReceiver(FPS)
    receiver.accept(beat(first, terms, 0.0), 0.05)
    receiver.show(0.1)
    assert len(receiver.show(600.1).times) == pytest.approx(600 * FPS, abs=1)
    receiver.accept(changed(second, stamp=600.0), 600.2)
    assert len(receiver.finish(602.0).times) > 0


def test_very_many_datagrams_of_strangers_take_no_more_memory_than_a_few():
    random = np.random.default_rng(0)
    first, _, terms = still()
    receiver = LiveReceiver(FPS)
    receiver.accept(beat(first, terms, 0.0), 0.05)
    size = len(first)
    tracemalloc.start()
    try:
        for batch in range(1000 if THOROUGH else 100):
            data = random.integers(0, 256, (1000, size), dtype=np.uint8)
            headers = np.ascontiguousarray(data[:, : HEADER.itemsize]).view(HEADER)[:, 0]
            headers["kind"], headers["packing"], headers["stream"] = 1, 0, receiver.stream
            headers["age"], headers["stamp"] = 0.0, np.where(random.random(1000) < 0.5, batch, headers["stamp"])
            data[:, : HEADER.itemsize] = headers[:, None].view(np.uint8)
            data[::2] = sealed(data[::2])
            for row in data:
                receiver.accept(row.tobytes(), 0.1 + batch * 0.01)
            assert receiver.remembered <= MOST_PACKETS
            if batch == 10:
                _, before = tracemalloc.get_traced_memory()
            if batch % 25 == 24:
                shown = receiver.show(0.1 + batch * 0.01)
                assert np.isfinite(shown.poses.positions).all()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < before + 60e6
