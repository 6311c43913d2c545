"""The vectors of the wire format, which others test their programs by."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.streams import Receiver
from rigid_motion.streams.coding import Decoder, Encoder
from rigid_motion.streams.messages import Codec, Said, State
from rigid_motion.streams.wire import (
    DESCRIPTION,
    LATE,
    kind_of,
    read_answer,
    read_description,
    read_motion,
    read_piece,
)

VECTORS = json.loads((Path(__file__).parent / "vectors.json").read_text(encoding="utf-8"))
STREAM = VECTORS["stream"]
DATAGRAMS = [bytes.fromhex(row["bytes"]) for row in STREAM["datagrams"]]


@pytest.mark.parametrize("case", VECTORS["coding"])
def test_symbols(case: dict) -> None:
    encoder, decoder = Encoder(), Decoder(bytes.fromhex(case["bytes"]))
    for step in case["steps"]:
        if "flat" in step:
            encoder.flat(step["flat"], step["symbol"])
            assert decoder.flat(step["flat"]) == step["symbol"]
        else:
            encoder.symbol(step["table"], step["symbol"])
            assert decoder.symbol(step["table"]) == step["symbol"]
    assert encoder.finish().hex() == case["bytes"]


def test_messages() -> None:
    pieces = [read_piece(datagram) for datagram in DATAGRAMS if kind_of(datagram) == DESCRIPTION]
    forest, terms = read_description(b"".join(piece.data for piece in pieces[: pieces[0].pieces]))
    assert [body.name for body in forest.bodies] == ["performer", "tool"]
    codec = Codec(forest, terms)
    motions = [read_motion(datagram) for datagram in DATAGRAMS if kind_of(datagram) != DESCRIPTION]
    states, payloads = {}, {row["payload"]: row for row in STREAM["messages"]}
    for motion in motions:
        expected = payloads[motion.payload.hex()]
        state = states.get(motion.sequence - motion.back) if motion.back else codec.rest
        kind = state.kind(motion.ticks, motion.back)
        said, memory = codec.read(motion.payload, kind, state, motion.late)
        assert kind == expected["kind"]
        assert said == Said(expected["finer"], expected["cells"], expected["groups"], expected["late"])
        assert list(memory) == expected["memory"]
        assert codec.write(said, kind, state, motion.late)[0] == motion.payload
        states[motion.sequence] = State(codec.path(said, state, kind, motion.ticks), memory, motion.ticks)


def test_what_is_shown() -> None:
    receiver = Receiver()
    for row, datagram in zip(STREAM["datagrams"], DATAGRAMS, strict=True):
        receiver.take(datagram, row["time"])
    (keys,) = receiver.keys()
    np.testing.assert_allclose(keys.moments, STREAM["moments"], atol=1e-12)
    for name, poses in keys.poses.items():
        np.testing.assert_allclose(poses.positions, STREAM["positions"][name], atol=2e-9)
        np.testing.assert_allclose(poses.quaternions, STREAM["quaternions"][name], atol=2e-9)


def test_answers() -> None:
    for row in STREAM["answers"]:
        receiver, entries = read_answer(bytes.fromhex(row["bytes"]))
        assert receiver == bytes((7, 8, 9))
        assert [entry.identity for entry in entries] == [bytes((1, 2, 3))]


def test_late_ones_are_there() -> None:
    assert any(kind_of(datagram) == LATE for datagram in DATAGRAMS)
