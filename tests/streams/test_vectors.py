"""Tests of the wire format's vectors, with which other implementations test themselves."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.streams import Receiver
from rigid_motion.streams.coding import FIRST_LONG_MAGNITUDE, LAST_TABLE_BITS, Coder
from rigid_motion.streams.messages import Codec
from rigid_motion.streams.wire import Answer, Description, EncodedMotion, read, read_description, write

from .make_vectors import IDENTITY, RECEIVER, noted_of

VECTORS = json.loads((Path(__file__).parent / "vectors.json").read_text(encoding="utf-8"))
STREAM = VECTORS["stream"]
DATAGRAMS = [bytes.fromhex(row["bytes"]) for row in STREAM["datagrams"]]


@pytest.mark.parametrize("case", VECTORS["coding"])
def test_symbols(case: dict) -> None:
    encoder, decoder = Coder(), Coder(bytes.fromhex(case["bytes"]))
    for step in case["steps"]:
        if "flat" in step:
            encoder.flat(step["flat"], step["symbol"])
            assert decoder.flat(step["flat"]) == step["symbol"]
        else:
            encoder.symbol(step["table"], step["symbol"])
            assert decoder.symbol(step["table"]) == step["symbol"]
    assert encoder.finish().hex() == case["bytes"]


def test_messages() -> None:
    read_ones = [read(datagram) for datagram in DATAGRAMS]
    assert [write(own) for own in read_ones] == DATAGRAMS
    descriptions = [own for own in read_ones if isinstance(own, Description)]
    forest, terms = read_description(descriptions[0].data)
    assert [body.name for body in forest.bodies] == ["performer", "tool"]
    codec, known = Codec(forest, terms), {}
    messages = {row["data"]: row for row in STREAM["messages"]}
    for motion in (own for own in read_ones if isinstance(own, EncodedMotion)):
        expected = messages[motion.data.hex()]
        message = codec.code(Coder(motion.data), lambda back: known[motion.sequence - back])  # noqa: B023
        assert noted_of(message) | {"data": motion.data.hex()} == expected
        base = known[motion.sequence - message.back] if message.back else codec.rest
        assert codec.write(message, base) == motion.data
        known[motion.sequence] = message
    assert {said["kind"] for said in STREAM["messages"]} >= {0, 3}
    assert [len(said["holds"]) for said in STREAM["messages"]].count(1) > 1
    assert any(0 < said["end"] - said["start"] < terms.delay for said in STREAM["messages"])
    assert max(np.abs(said["groups"]).max() for said in STREAM["messages"]) >= FIRST_LONG_MAGNITUDE + (
        1 << LAST_TABLE_BITS
    )


def test_what_is_shown() -> None:
    receiver = Receiver()
    for row, datagram in zip(STREAM["datagrams"], DATAGRAMS, strict=True):
        receiver.take(datagram, row["time"])
    (keys,) = receiver.keys()
    np.testing.assert_allclose(keys.moments, STREAM["moments"], atol=1e-12)
    for name, poses in keys.poses.items():
        np.testing.assert_allclose(poses.positions.swapaxes(0, 1), STREAM["positions"][name], atol=2e-9)
        np.testing.assert_allclose(poses.quaternions.swapaxes(0, 1), STREAM["quaternions"][name], atol=2e-9)


def test_answers() -> None:
    for row in STREAM["answers"]:
        answer = read(bytes.fromhex(row["bytes"]))
        assert isinstance(answer, Answer)
        assert (answer.identity, answer.receiver) == (IDENTITY, RECEIVER)
