"""Fuzz tests of receivers: any datagram raises no exception, uses bounded memory, and leaves other streams alone.

RIGID_MOTION_FUZZ=10000000 tries that many datagrams.
"""

from __future__ import annotations

import json
import os
import tracemalloc
import zlib

import numpy as np
import pytest

from rigid_motion.motion.poses import joined
from rigid_motion.streams import Receiver, Sender, StreamBody, vmc
from rigid_motion.streams.coding import Coder
from rigid_motion.streams.messages import Codec
from rigid_motion.streams.receiver import MOST_ALL_JOINTS, MOST_STREAMS
from rigid_motion.streams.wire import WIRE_VERSION, read, read_description

from .links import body, dance, run

DATAGRAMS = int(os.environ.get("RIGID_MOTION_FUZZ", "6000"))

MOST_BYTES = 128 << 20
"""The most bytes that a receiver ever holds."""

TRACED = 100_000
"""Number of datagrams after which allocations are no longer traced, because tracing takes most of the time."""

RENEWED = 200
"""Number of datagrams after which strangers take another identity: a stream's numbers are soon used up."""


@pytest.fixture(scope="module")
def genuine() -> list[bytes]:
    """Of a performer who takes a tool, and of a program that sends VMC."""
    own, tool = body(), StreamBody.rigid("tool")
    times, poses = dance(own, 3.0)
    both = joined((poses, poses[-1:]))
    outcome = run([own, tool], times, both, says={60: ("tool", own.name, own.joints[-1])}, answers=False)
    frames = [dict.fromkeys(vmc.JOINTS, poses[0, row]) for row in range(5)]
    return [datagram for _, datagram in outcome.datagrams] + [
        datagram for row, frame in enumerate(frames) for datagram in vmc.write(times[row], frame)
    ]


def damaged(rng: np.random.Generator, genuine: list[bytes]) -> bytes:
    """Return random bytes, or a genuine datagram with bits flipped, cut off, extended, or spliced from two."""
    kind = rng.integers(6)
    if kind == 0:
        head = bytes([WIRE_VERSION << 4 | int(rng.integers(5))]) if rng.random() < 0.8 else b""
        return head + rng.bytes(int(rng.integers(0, 80)))
    data = bytearray(genuine[rng.integers(len(genuine))])
    if kind in (1, 2):
        for _ in range(int(rng.integers(1, 6))):
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    elif kind == 3:
        del data[int(rng.integers(len(data))) :]
    elif kind == 4:
        data += rng.bytes(int(rng.integers(1, 4000 if rng.random() < 0.1 else 20)))
    else:
        other, cut = genuine[rng.integers(len(genuine))], int(rng.integers(10))
        data = data[:cut] + other[cut:]
    return bytes(data)


@pytest.mark.slow
def test_any_datagram_does_no_harm(genuine: list[bytes]) -> None:
    rng, own = np.random.default_rng(5), body()
    times, poses = dance(own, 4.0)
    receiver, alone, sender = Receiver(), Receiver(), Sender([own], rate=60.0)
    a_sample = -(-DATAGRAMS // len(times))
    tracemalloc.start()
    most = 0
    for row, now in enumerate(times.tolist()):
        for datagram in sender.add(now, poses[:, row]):
            receiver.take(datagram, now, "friend")
            alone.take(datagram, now, "friend")
        for number in range(a_sample):
            if number % RENEWED == 0:
                identity = rng.bytes(3)
                renewed = [datagram[:1] + identity + datagram[4:] for datagram in genuine]
            datagram = damaged(rng, renewed)
            receiver.take(datagram, now, f"stranger {rng.integers(3)}")
            sender.take_answer(datagram, now)
        shown, expected = receiver.show(now), alone.show(now)
        receiver.keys()
        receiver.answers()
        assert len(shown) <= MOST_STREAMS
        for stream, only in expected.items():
            np.testing.assert_array_equal(shown[stream].poses[own.name].positions, only.poses[own.name].positions)
        for strange in shown.values():
            for part in strange.poses.values():
                assert np.isfinite(part.positions).all()
                assert np.isfinite(part.quaternions).all()
        most = max(most, tracemalloc.get_traced_memory()[1])
        if row * a_sample > TRACED:
            tracemalloc.stop()
    tracemalloc.stop()
    assert expected
    assert most < MOST_BYTES


def test_flipped_bits_from_the_sender_itself_do_no_lasting_harm(genuine: list[bytes]) -> None:
    rng, own = np.random.default_rng(6), body()
    times, poses = dance(own, 20.0 if DATAGRAMS > 10000 else 6.0)
    receiver, sender = Receiver(), Sender([own], rate=60.0)
    for row, now in enumerate(times.tolist()):
        for datagram in sender.add(now, poses[:, row]):
            data = bytearray(datagram)
            if rng.random() < 0.2 and now < times[-1] - 2.5:
                data[rng.integers(4, len(data))] ^= 1 << int(rng.integers(8))
            receiver.take(bytes(data), now, "friend")
        receiver.show(now)
    assert receiver.show(times[-1])


WRONG = (None, True, 1.5, -1, 0, 10**400, -(10**30), "", "x", [], [[]], {}, {"a": 1}, float("nan"), float("inf"))
"""Values that replace parts of a description."""


def packed(text: str) -> bytes:
    compressor = zlib.compressobj(wbits=-15)
    return compressor.compress(text.encode()) + compressor.flush()


def test_any_description_is_read_or_none() -> None:
    rng = np.random.default_rng(7)
    datagram = Sender([body(3), StreamBody.rigid("tool")]).describe()[0]
    genuine = json.loads(zlib.decompress(read(datagram).data, wbits=-15))

    def changed(part: object) -> object:
        if isinstance(part, list) and part and rng.random() < 0.85:
            place = rng.integers(len(part))
            return [*part[:place], changed(part[place]), *part[place + 1 :]]
        return WRONG[rng.integers(len(WRONG))]

    there = 0
    for _ in range(2000):
        if described := read_description(packed(json.dumps(changed(genuine)))):
            there += 1
            Codec(*described).code(Coder(rng.bytes(30)), lambda back: None)
    assert 0 < there < 1000
    for text in ("[" * 100_000, '{"a":' * 20_000, f"[{'9' * 5000},1,1,[]]", "[5000,360,60,[", "1", '"abcd"'):
        assert read_description(packed(text)) is None


@pytest.mark.slow
def test_strangers_cannot_fill_the_memory() -> None:
    receiver, own = Receiver(), body(200)
    sent = [Sender([own]).add(0.0, own.rest) for _ in range(3 * MOST_STREAMS)]
    tracemalloc.start()
    for number, datagrams in enumerate(sent):
        for datagram in datagrams:
            receiver.take(bytes(bytearray(datagram)), 0.0, number)  # in new memory, as from a socket
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0 < 200 * len(receiver.streams) <= MOST_ALL_JOINTS
    assert most < MOST_BYTES
