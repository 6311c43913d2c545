"""Open Sound Control 1.0: messages and bundles as bytes, and back. Whatever comes: what is not OSC is no message.

Source: "The Open Sound Control 1.0 Specification" (Wright, 2002). Big-endian, everything in steps of four bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice
from typing import Any, NamedTuple

BUNDLE = b"#bundle\0"

IMMEDIATELY = struct.pack(">Q", 1)
"""The time tag of a bundle that is for now."""

DEEPEST, MOST_MESSAGES = 4, 2048
"""Bundles in one another, and messages of a datagram."""

FORMATS = {"i": ">i", "f": ">f", "h": ">q", "d": ">d", "t": ">Q"}
CONSTANTS = {"T": True, "F": False, "N": None}
"""Types of OSC beside texts and blobs, as `struct` has them; and those that are all said by their type."""


class Message(NamedTuple):
    """An address, and what is said to it."""

    address: str
    arguments: tuple[object, ...]


def write_message(address: str, *arguments: float | str) -> bytes:
    """Return a message of strings, whole numbers, and floats in single precision."""
    tags, data = ",", b""
    for argument in arguments:
        tag = "s" if isinstance(argument, str) else "i" if isinstance(argument, int) else "f"
        tags += tag
        data += _padded(argument) if isinstance(argument, str) else struct.pack(f">{tag}", argument)
    return _padded(address) + _padded(tags) + data


def write_bundle(messages: Iterable[bytes]) -> bytes:
    """Messages that belong together, for now."""
    return BUNDLE + IMMEDIATELY + b"".join(struct.pack(">I", len(message)) + message for message in messages)


def is_osc(datagram: bytes) -> bool:
    """Whether a datagram begins as OSC does."""
    return datagram.startswith((b"/", BUNDLE))


def read(datagram: bytes) -> list[Message]:
    """All messages of a datagram, until the first thing that is none."""
    result: list[Message] = []
    with suppress(ValueError, struct.error):  # as if it ended there
        result.extend(islice(_messages(datagram, DEEPEST), MOST_MESSAGES))
    return result


def _padded(text: str) -> bytes:
    data = text.encode()
    return data + bytes(4 - len(data) % 4)


def _messages(data: bytes, depth: int) -> Iterator[Message]:
    if not data.startswith(BUNDLE):
        address, at = _argument("s", data, 0)
        tags, at = _argument("s", data, at)
        if address[:1] != "/" or tags[:1] != ",":
            raise ValueError("a message has an address and types")
        arguments = []
        for tag in tags[1:]:
            argument, at = _argument(tag, data, at)
            arguments.append(argument)
        yield Message(address, tuple(arguments))
        return
    at = len(BUNDLE) + len(IMMEDIATELY)
    while at < len(data):
        part, at = _argument("b", data, at)
        if not depth:
            raise ValueError("too many bundles in one another")
        yield from _messages(part, depth - 1)


def _argument(tag: str, data: bytes, at: int) -> tuple[Any, int]:
    """Return what is at a place, of some type, and where what follows begins."""
    if tag == "s":
        end = data.index(b"\0", at)
        return data[at:end].decode(), end + 4 - end % 4
    if tag == "b":
        (size,) = struct.unpack_from(">I", data, at)
        end = at + 4 + size
        if end > len(data):
            raise ValueError("it is cut off")
        return data[at + 4 : end], end + -size % 4
    if tag in CONSTANTS:
        return CONSTANTS[tag], at
    if tag not in FORMATS:
        raise ValueError("there is no such type")
    (number,) = struct.unpack_from(FORMATS[tag], data, at)
    return number, at + struct.calcsize(FORMATS[tag])
