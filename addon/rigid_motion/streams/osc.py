"""Open Sound Control 1.0: messages and bundles as bytes, and back. Whatever comes: what is not OSC is no message.

Source: "The Open Sound Control 1.0 Specification" (Wright, 2002). Big-endian, everything in steps of four bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

BUNDLE = b"#bundle\0"

DEEPEST = 4
"""Bundles in one another."""

MOST_MESSAGES = 2048
"""Of a datagram."""

IMMEDIATELY = struct.pack(">Q", 1)
"""The time tag of a bundle that is for now."""

NUMBERS = {"i": "i", "f": "f", "h": "q", "d": "d", "t": "Q"}
"""Types of OSC, as `struct` has them."""

CONSTANTS = {"T": True, "F": False, "N": None}


class Message(NamedTuple):
    """An address, and what is said to it."""

    address: str
    arguments: tuple[object, ...]


def write_message(address: str, *arguments: float | str) -> bytes:
    """Return a message of strings, whole numbers, and floats in single precision."""
    tags, data = ",", b""
    for argument in arguments:
        if isinstance(argument, str):
            tags, data = tags + "s", data + _padded(argument)
        elif isinstance(argument, int):
            tags, data = tags + "i", data + struct.pack(">i", argument)
        else:
            tags, data = tags + "f", data + struct.pack(">f", argument)
    return _padded(address) + _padded(tags) + data


def write_bundle(messages: Iterable[bytes]) -> bytes:
    """Messages that belong together, for now."""
    return BUNDLE + IMMEDIATELY + b"".join(struct.pack(">I", len(message)) + message for message in messages)


def is_osc(datagram: bytes) -> bool:
    """Whether a datagram begins as OSC does."""
    return datagram[:1] == b"/" or datagram.startswith(BUNDLE)


def read(datagram: bytes) -> list[Message]:
    """All messages of a datagram, until the first thing that is none."""
    result: list[Message] = []
    try:
        for message in _messages(datagram, DEEPEST):
            result.append(message)
            if len(result) == MOST_MESSAGES:
                break
    except (ValueError, struct.error):
        pass  # as if it ended here
    return result


def _padded(text: str) -> bytes:
    data = text.encode()
    return data + bytes(4 - len(data) % 4)


def _messages(data: bytes, depth: int) -> Iterator[Message]:
    if not data.startswith(BUNDLE):
        yield _message(data)
        return
    if not depth:
        raise ValueError
    at = len(BUNDLE) + len(IMMEDIATELY)
    while at < len(data):
        (size,) = struct.unpack_from(">I", data, at)
        at += 4 + size
        if at > len(data):
            raise ValueError
        yield from _messages(data[at - size : at], depth - 1)


def _message(data: bytes) -> Message:
    address, at = _string(data, 0)
    tags, at = _string(data, at)
    if address[:1] != "/" or tags[:1] != ",":
        raise ValueError
    arguments: list[object] = []
    for tag in _parts(tags[1:]):
        if tag in CONSTANTS:
            arguments.append(CONSTANTS[tag])
        elif isinstance(tag, struct.Struct):
            arguments += tag.unpack_from(data, at)
            at += tag.size
        elif tag == "s":
            text, at = _string(data, at)
            arguments.append(text)
        elif tag == "b":
            (size,) = struct.unpack_from(">I", data, at)
            if at + 4 + size > len(data):
                raise ValueError
            arguments.append(data[at + 4 : at + 4 + size])
            at += 4 + size + -size % 4
        else:
            raise ValueError
    return Message(address, tuple(arguments))


@lru_cache(256)
def _parts(tags: str) -> list[str | struct.Struct]:
    """Types one by one, but for numbers, which are read together where they are side by side."""
    runs = re.findall(f"[{''.join(NUMBERS)}]+|.", tags, re.DOTALL)
    return [struct.Struct(">" + "".join(NUMBERS[kind] for kind in run)) if run[0] in NUMBERS else run for run in runs]


def _string(data: bytes, at: int) -> tuple[str, int]:
    """Return a text, and where what follows begins."""
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 4 - end % 4
