"""Open Sound Control 1.0: messages and bundles to bytes, and back. Invalid data reads as no message.

Source: "The Open Sound Control 1.0 Specification" (Wright, 2002). Big-endian, everything in multiples of four bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice
from typing import NamedTuple

BUNDLE = b"#bundle\0"

IMMEDIATELY = struct.pack(">Q", 1)
"""Time tag of a bundle for immediate use."""

MAX_BUNDLE_DEPTH, MAX_MESSAGES = 4, 2048
"""Most levels of nested bundles, and most messages of a datagram."""

FORMATS = {"i": ">i", "f": ">f", "h": ">q", "d": ">d"}
"""`struct` formats of number types. Besides them VMC has only strings."""


class OscMessage(NamedTuple):
    """An address and arguments."""

    address: str
    arguments: tuple[object, ...]


def write_message(address: str, *arguments: float | str) -> bytes:
    """Return a message with strings, integers, and single-precision floats as arguments."""
    tags, data = ",", b""
    for argument in arguments:
        tag = "s" if isinstance(argument, str) else "i" if isinstance(argument, int) else "f"
        tags += tag
        data += _padded(argument) if isinstance(argument, str) else struct.pack(f">{tag}", argument)
    return _padded(address) + _padded(tags) + data


def write_bundle(messages: Iterable[bytes]) -> bytes:
    """Return a bundle of messages, for immediate use."""
    return BUNDLE + IMMEDIATELY + b"".join(struct.pack(">I", len(message)) + message for message in messages)


def is_osc(datagram: bytes) -> bool:
    """Whether a datagram begins like OSC."""
    return datagram.startswith((b"/", BUNDLE))


def read(datagram: bytes) -> list[OscMessage]:
    """Return all messages of a datagram, except damaged ones and ones with other argument types."""
    result: list[OscMessage] = []
    for part in islice(_unbundled(datagram, MAX_BUNDLE_DEPTH), MAX_MESSAGES):
        with suppress(KeyError, ValueError, struct.error):
            result.append(_message(part))
    return result


def _padded(text: str) -> bytes:
    data = text.encode()
    return data + bytes(4 - len(data) % 4)


def _unbundled(data: bytes, depth: int) -> Iterator[bytes]:
    """Yield the messages of nested bundles."""
    if not data.startswith(BUNDLE):
        yield data
    elif depth:
        at = len(BUNDLE) + len(IMMEDIATELY) + 4
        while at <= len(data):
            end = at + int.from_bytes(data[at - 4 : at], "big")
            yield from _unbundled(data[at:end], depth - 1)
            at = end + 4


def _message(data: bytes) -> OscMessage:
    address, at = _text(data, 0)
    tags, at = _text(data, at)
    if address[:1] != "/" or tags[:1] != ",":
        raise ValueError("a message has an address and types")
    arguments: list[object] = []
    for tag in tags[1:]:
        if tag == "s":
            text, at = _text(data, at)
            arguments.append(text)
        else:
            arguments += struct.unpack_from(FORMATS[tag], data, at)
            at += struct.calcsize(FORMATS[tag])
    return OscMessage(address, tuple(arguments))


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return the string at an offset, and the offset after it."""
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 4 - end % 4
