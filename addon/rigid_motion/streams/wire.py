"""Datagrams: descriptions, motions and answers. docs/wire.md draws their bytes. Little-endian throughout.

Reading never raises: what is no datagram of this version is None.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..motion import Poses
from .bodies import MOST_JOINTS, Body, Forest

VERSION = 2

TICKS = 3600
"""A second, in the unit of all times on the wire: whole numbers of it are the frames of 24, 25, 30, 60, 72, 90, 120."""

DESCRIPTION, MOTION, LATE, ANSWER, NEXT = range(5)
"""Kinds of datagrams. `LATE` is a motion that was sent later than at the end of its window, and `NEXT` one that builds
on the message before."""

HEAD = struct.Struct("<B3s")
"""Version and kind; identity."""

MOTION_HEAD = struct.Struct("<B3sHH")
"""Version and kind; identity; sequence; ticks of the end of the window. Behind it, but for `NEXT`, is a byte: by how
much to go back for the base, or 0."""

DESCRIPTION_HEAD = struct.Struct("<B3sBBQ")
"""Version and kind; identity; number of the piece; pieces; the sender's ticks."""

TERMS = struct.Struct("<IHHB")
"""Tolerance in micrometres; delay and grid in ticks; bodies."""

BODY, JOINT = struct.Struct("<IH"), struct.Struct("<hB7f")
"""Behind their names: radius in micrometres and joints; parent, whether it slides, and the pose at rest."""

ENTRY = struct.Struct("<3sHIB")
"""Of an answer: identity; newest sequence; which of the 32 before it there are; what is missing."""

NEEDS_DESCRIPTION, NEEDS_REFRESH = 1, 2

LONGEST = 65_000
"""Bytes of a datagram, as UDP carries them: a message of 4096 groups is never longer."""

UNCUT = 1200
"""Bytes of a datagram that no network cuts up: so long are descriptions and answers at most, and most messages."""

MOST_PIECES, MOST_ENTRIES = 64, (UNCUT - HEAD.size) // ENTRY.size

MOST_TICKS = 1 << 48
"""Of a sender's clock: seconds as floats still tell ticks apart."""

MOST_DESCRIBED = 1 << 17
"""Bytes of a description, unpacked."""

LONGEST_DELAY = 8 * TICKS
"""Half of what 16 bits of ticks can tell apart is more."""


class Terms(NamedTuple):
    """What sender and receivers agree on."""

    tolerance: int
    """Micrometres."""

    delay: int
    """Ticks by which what is shown is behind what is sent."""

    grid: int
    """Ticks between the moments at which knots may be, counted back from the end of a window."""

    @property
    def cells(self) -> int:
        """Moments of the grid within a window."""
        return max((self.delay - 1) // self.grid, 0)


class Motion(NamedTuple):
    """A message, not yet decoded."""

    identity: bytes
    sequence: int
    ticks: int
    """The lowest 16 bits."""
    back: int
    payload: bytes
    late: bool


class Piece(NamedTuple):
    """Of a description."""

    identity: bytes
    number: int
    pieces: int
    ticks: int
    data: bytes


class Entry(NamedTuple):
    """What an answer says of one stream."""

    identity: bytes
    newest: int
    before: int
    """Bit i: sequence newest - 1 - i is there."""
    needs: int

    def has(self, sequence: int) -> bool:
        """Whether a sequence is there, as far as this says."""
        back = (self.newest - sequence) & 0xFFFF
        there = (self.before << 1 | 1) >> back & 1 if back <= 32 else 0
        return bool(there) and not self.needs & NEEDS_DESCRIPTION


def kind_of(datagram: bytes) -> int | None:
    """Return the kind of a datagram of this version, or None."""
    if not HEAD.size <= len(datagram) <= LONGEST or datagram[0] >> 4 != VERSION:
        return None
    return datagram[0] & 15


def motion(identity: bytes, sequence: int, ticks: int, back: int, payload: bytes, late: bool = False) -> bytes:
    """Return the datagram of a message."""
    kind = LATE if late else NEXT if back == 1 else MOTION
    head = MOTION_HEAD.pack(VERSION << 4 | kind, identity, sequence, ticks & 0xFFFF)
    return head + (b"" if kind == NEXT else bytes([back])) + payload


def read_motion(datagram: bytes) -> Motion | None:
    """Return a message, or None."""
    kind = kind_of(datagram)
    size = MOTION_HEAD.size + (kind != NEXT)
    if len(datagram) < size:
        return None
    _, identity, sequence, ticks = MOTION_HEAD.unpack_from(datagram)
    back = 1 if kind == NEXT else datagram[size - 1]
    return Motion(identity, sequence, ticks, back, datagram[size:], kind == LATE)


def answer(receiver: bytes, entries: Sequence[Entry]) -> bytes:
    """Return the datagram of an answer."""
    return HEAD.pack(VERSION << 4 | ANSWER, receiver) + b"".join(ENTRY.pack(*entry) for entry in entries)


def read_answer(datagram: bytes) -> tuple[bytes, list[Entry]] | None:
    """Who answers, and what; or None."""
    if (len(datagram) - HEAD.size) % ENTRY.size:
        return None
    return datagram[1 : HEAD.size], [Entry(*fields) for fields in ENTRY.iter_unpack(datagram[HEAD.size :])]


def describe(identity: bytes, ticks: int, forest: Forest, terms: Terms) -> list[bytes]:
    """Return the datagrams of a description."""
    parts = [TERMS.pack(*terms, len(forest.bodies))]
    for body in forest.bodies:
        assert body.sliding is not None
        parts += [_named(body.name), BODY.pack(round(body.radius * 1e6), len(body.joints))]
        for name, parent, slides, rest in zip(body.joints, body.parents, body.sliding, body.rest, strict=True):
            parts += [_named(name), JOINT.pack(parent, int(slides), *rest.positions, *rest.quaternions)]
    packed = zlib.compress(b"".join(parts), 9)
    size = UNCUT - DESCRIPTION_HEAD.size
    cut = [packed[at : at + size] for at in range(0, len(packed), size)]
    return [
        DESCRIPTION_HEAD.pack(VERSION << 4 | DESCRIPTION, identity, number, len(cut), ticks) + piece
        for number, piece in enumerate(cut)
    ]


def read_piece(datagram: bytes) -> Piece | None:
    """Return a piece of a description, or None."""
    if len(datagram) <= DESCRIPTION_HEAD.size:
        return None
    _, identity, number, pieces, ticks = DESCRIPTION_HEAD.unpack_from(datagram)
    piece = Piece(identity, number, pieces, ticks, datagram[DESCRIPTION_HEAD.size :])
    return piece if piece.number < piece.pieces <= MOST_PIECES and piece.ticks < MOST_TICKS else None


def read_description(packed: bytes) -> tuple[Forest, Terms] | None:
    """Return the bodies and the terms of all pieces of a description, or None."""
    try:
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(packed, MOST_DESCRIBED)
        return _described(data) if unpacking.eof else None
    except (zlib.error, struct.error, ValueError, IndexError):
        return None


def _described(data: bytes) -> tuple[Forest, Terms]:
    *numbers, count = TERMS.unpack_from(data)
    terms, at = Terms(*numbers), TERMS.size
    if not (terms.tolerance and terms.grid and 0 < terms.delay <= LONGEST_DELAY):
        raise ValueError("such terms are none")
    bodies, total = [], 0
    for _ in range(count):
        name, at = _read_name(data, at)
        radius, joints = BODY.unpack_from(data, at)
        at, total, names, rows = at + BODY.size, total + joints, [], []
        if total > MOST_JOINTS:
            raise ValueError("more joints than there may be")
        for _ in range(joints):
            own, at = _read_name(data, at)
            names.append(own)
            rows.append(JOINT.unpack_from(data, at))
            at += JOINT.size
        table = np.array(rows, dtype=np.float64).reshape(-1, 9)
        parents, sliding, rest = table[:, 0], table[:, 1], table[:, 2:]
        lengths = np.linalg.norm(rest[:, 3:], axis=1)
        if not (np.abs(rest) < 1e6).all() or not (lengths > 0.5).all():
            raise ValueError("such a pose at rest is none")
        poses = Poses(rest[:, :3], rest[:, 3:] / lengths[:, None])
        bodies.append(Body(name, tuple(names), parents, poses, radius / 1e6, sliding))
    if at != len(data):
        raise ValueError("more than there should be")
    return Forest(bodies), terms


def _named(name: str) -> bytes:
    data = name.encode(errors="replace")
    return bytes([len(data)]) + data


def _read_name(data: bytes, at: int) -> tuple[str, int]:
    end = at + 1 + data[at]
    if end > len(data):
        raise IndexError("a name is cut off")
    return data[at + 1 : end].decode(), end


def expanded(ticks: int, near: float) -> int:
    """Return the whole of a number of ticks, of which the lowest 16 bits are given, nearest to another number."""
    nearest = math.floor(near)
    return nearest + ((ticks - nearest + 0x8000) & 0xFFFF) - 0x8000
