"""Tests of OSC against python-osc, an independent implementation."""

from __future__ import annotations

import pytest
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

from rigid_motion.streams import osc

TYPES = ((), ("name",), ("", "abc", "abcd"), (1, -7), (0.5, -1e20), ("Hips", 0.25, 3, "ü"))


def theirs(address: str, *arguments: object) -> OscMessage:
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(argument)
    return builder.build()


@pytest.mark.parametrize("arguments", TYPES)
def test_messages_are_the_bytes_of_the_other_implementation(arguments):
    written = osc.write_message("/VMC/Ext/Test", *arguments)
    assert written == theirs("/VMC/Ext/Test", *arguments).dgram
    assert OscMessage(written).params == pytest.approx(list(arguments))
    (read,) = osc.read(written)
    assert read.address == "/VMC/Ext/Test"
    assert list(read.arguments) == pytest.approx(list(arguments))


def test_numbers_of_all_sizes_are_read():
    builder = OscMessageBuilder("/all")
    for kind, value in [("h", 2**40), ("d", 1 / 3), ("f", 0.5), ("i", 4)]:
        builder.add_arg(value, kind)
    (read,) = osc.read(builder.build().dgram)
    assert read.arguments == (2**40, 1 / 3, 0.5, 4)


@pytest.mark.parametrize("argument", [True, False, None, b"12345"])
def test_a_message_of_other_types_takes_nothing_else_with_it(argument):
    bundle = OscBundleBuilder(IMMEDIATELY)
    for message in (theirs("/a", 1), theirs("/other", argument), theirs("/b", 2)):
        bundle.add_content(message)
    assert [message.address for message in osc.read(bundle.build().dgram)] == ["/a", "/b"]


def test_what_is_no_message_is_none():
    assert osc.read(b"/a\0\0types\0\0\0") == []


def test_bundles_are_read_in_bundles():
    inner, outer = OscBundleBuilder(IMMEDIATELY), OscBundleBuilder(IMMEDIATELY)
    inner.add_content(theirs("/a", 1))
    inner.add_content(theirs("/b", 2.0))
    outer.add_content(inner.build())
    outer.add_content(theirs("/c", "three"))
    assert [message.address for message in osc.read(outer.build().dgram)] == ["/a", "/b", "/c"]
    written = osc.write_bundle([osc.write_message("/a", 1), osc.write_message("/b", 2.0)])
    assert [message.address for message in OscBundle(written)] == ["/a", "/b"]


def test_bundles_that_hold_themselves_end():
    data = osc.write_message("/deep", 1)
    for _ in range(50):
        data = osc.write_bundle([data])
    assert osc.read(data) == []
