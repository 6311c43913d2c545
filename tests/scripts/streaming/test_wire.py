"""What goes over the wire is said in so many bytes, read back exactly, and not mistaken for anything else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.motion import MODES
from rigid_motion_batch.streaming import PACKINGS, TWISTS, Packets, PlayOut
from rigid_motion_batch.streaming.packets import HEADER, KEY, sealed
from rigid_motion_batch.streaming.wire import (
    BEAT,
    BYE,
    CHALLENGE,
    HELLO,
    LARGEST,
    NUMBERS,
    TERMS,
    Terms,
    beat,
    bye,
    challenge,
    changed,
    hello,
    key_of,
    read,
)
from tests.scripts.streaming.motions import swinging

PLAIN = Terms.of("dq_sclerp", 0.05, PlayOut(wait=1.0))
BENT = Terms.of(TWISTS, 0.05, PlayOut(wait=2.0, fade=0.5, lead=0.0))


def key(packing: str = "double", twisted: bool = False) -> bytes:
    times, poses = swinging()
    twists = np.ones((1, 6)) if twisted else None
    packets = Packets.of(times[5:6], poses[5:6], 0.05, PACKINGS[packing], twists=twists, first=3, stream=7)
    return packets.data[0].tobytes()


def resealed(datagram: bytes) -> bytes:
    return sealed(np.frombuffer(datagram, np.uint8)[None])[0].tobytes()


@pytest.mark.parametrize("packing", PACKINGS)
@pytest.mark.parametrize("twisted", [False, True])
def test_a_heartbeat_is_the_key_again_and_the_terms(packing, twisted):
    first, terms = key(packing, twisted), BENT if twisted else PLAIN
    again = beat(first, terms, 12.5)
    assert len(again) == len(first) + TERMS.itemsize <= LARGEST
    message = read(again)
    assert (message.kind, message.stream, message.sequence, message.age) == (BEAT, 7, 3, 12.5)
    assert message.stamp == read(first).stamp
    assert message.terms == terms
    assert message.layout == read(first).layout
    assert changed(key_of(again), age=0.0) == first


def test_the_sizes_are_those_of_the_page():
    sizes = [len(datagram) for datagram in (key(), beat(key(), PLAIN, 0.0), hello(), challenge(bytes(8)), bye())]
    assert sizes == [82, 103, 34, 34, 26]
    assert LARGEST == 26 + 56 + 48 + 21


def test_nothing_is_answered_with_more_bytes_than_it_has():
    least = min(len(key(packing)) for packing in PACKINGS)
    assert len(challenge(bytes(8))) <= min(least, len(hello()))


def test_hello_challenge_and_bye_are_read_back():
    assert (read(hello(b"12345678")).kind, read(hello(b"12345678")).cookie) == (HELLO, b"12345678")
    assert (read(challenge(b"12345678")).kind, read(challenge(b"12345678")).cookie) == (CHALLENGE, b"12345678")
    message = read(bye(7, 41, 3.25))
    assert (message.kind, message.stream, message.sequence, message.stamp) == (BYE, 7, 41, 3.25)


@pytest.mark.parametrize(
    "datagram", [key(), beat(key(), PLAIN, 1.0), hello(), bye(7)], ids=["key", "beat", "hello", "bye"]
)
def test_a_flipped_bit_or_a_byte_too_few_or_too_many_makes_it_none(datagram):
    for place in range(len(datagram) * 8):
        flipped = bytearray(datagram)
        flipped[place // 8] ^= 1 << place % 8
        assert read(bytes(flipped)) is None
    assert read(datagram[:-1]) is None
    assert read(resealed(datagram[:-1])) is None
    assert read(datagram + b"\0") is None
    assert read(resealed(datagram + b"\0")) is None


@pytest.mark.parametrize(
    "change", [{"kind": 9}, {"kind": HELLO}, {"packing": 3}, {"packing": 0x83}, {"stamp": np.nan}, {"age": np.inf}]
)
def test_what_is_sealed_and_means_nothing_is_none(change):
    assert read(changed(key(), **change)) is None


@pytest.mark.parametrize("terms", [BENT, PLAIN])
def test_terms_of_twists_are_for_keys_that_have_some(terms):
    assert read(beat(key(twisted=terms is PLAIN), terms, 0.0)) is None


def test_every_mode_has_a_number_of_its_own():
    assert set(NUMBERS) == {*MODES, TWISTS}
    assert len(set(NUMBERS.values())) == len(NUMBERS)
    for mode in NUMBERS:
        assert Terms.read(Terms.of(mode, 0.1, PlayOut(wait=2.0)).data).mode == mode


@pytest.mark.parametrize(
    ("interval", "play_out"),
    [
        (0.0, {}),
        (100.0, {}),
        (0.05, {"wait": 1e6}),
        (0.05, {"carry": 1e3}),
        (0.05, {"fade": 1e4}),
        (0.05, {"lead": 99.0}),
    ],
)
def test_terms_that_nobody_could_mean_are_refused(interval, play_out):
    with pytest.raises(ValueError, match=r"within|fade in"):
        Terms.of("dq_sclerp", interval, PlayOut(**{"wait": 1.0} | play_out))


def test_what_the_terms_say_is_how_the_receiver_deals_with_time():
    play_out = BENT.play_out(0.1)
    assert (play_out.latency, play_out.fade, play_out.lead) == (0.1, 0.5, 0.0)
    assert play_out.wait == pytest.approx(2.0)
    assert PLAIN.play_out(None).lead == 1.0
    assert Terms.of("motor_spline", 0.05, PlayOut(wait=2.0)).lead == 2.0


@given(st.binary(max_size=LARGEST + 2), st.integers(0, 6), st.booleans())
def test_bytes_of_strangers_are_read_or_refused_and_do_no_harm(data, kind, seal):
    if seal and len(data) >= HEADER.itemsize:
        data = changed(resealed(data), kind=kind)
    message = read(data)
    assert message is None or (seal and message.kind in (KEY, BEAT, HELLO, CHALLENGE, BYE))
