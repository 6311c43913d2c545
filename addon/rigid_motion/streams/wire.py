"""Wire format of datagrams: descriptions, motions and answers. docs/wire.md shows their bytes. Always little-endian.

Reading never raises: it returns None for anything that is not a datagram of this version.
"""

from __future__ import annotations

import json
import math
import zlib
from struct import Struct
from typing import NamedTuple

import numpy as np

from ..motion import Poses
from .bodies import MAX_LENGTH_M, MIN_LENGTH_M, Forest, StreamBody

WIRE_VERSION = 7

TICKS_PER_S = 3600
"""Ticks per second; all times on the wire are in ticks, which fit frames of 24, 25, 30, 60, 72, 90 and 120 fps."""

NEEDS_DESCRIPTION, NEEDS_REFRESH = 1, 2

MAX_BYTES = 65_000
"""Most bytes of a datagram, by the limit of UDP: a message of 4096 groups is never longer."""

MOST_DESCRIBED = 1 << 17
"""Most bytes of an unpacked description."""

LONGEST_DELAY = 8 * TICKS_PER_S
"""Longest delay and grid step, in ticks."""

RAW_BITS = -15
"""Window bits for zlib: raw DEFLATE without a header."""


class Terms(NamedTuple):
    """Parameters shared by sender and receivers: the tolerance in metres; the delay in ticks of the shown moment behind
    the sent one; and the ticks between possible knots, counted back from the end of a window.
    """

    tolerance: float
    delay: int
    grid: int


class Description(NamedTuple):
    """Bodies and terms, packed."""

    identity: bytes
    data: bytes


class EncodedMotion(NamedTuple):
    """A message, not yet decoded."""

    identity: bytes
    sequence: int
    data: bytes


class Answer(NamedTuple):
    """A receiver's report on a stream: the newest sequence, and in `before` bit i if newest - 1 - i has arrived."""

    identity: bytes
    receiver: bytes
    newest: int
    before: int
    needs: int

    def has_arrived(self, sequence: int) -> bool:
        """Whether a sequence has arrived, as far as this answer tells."""
        back = (self.newest - sequence) & 0xFFFF
        there = (self.before << 1 | 1) >> back & 1 if back <= 32 else 0
        return bool(there) and not self.needs & NEEDS_DESCRIPTION


Datagram = Description | EncodedMotion | Answer

KINDS: tuple[type[Datagram], ...] = (Description, EncodedMotion, Answer)
LAYOUTS = (Struct("<3s"), Struct("<3sH"), Struct("<3s3sHIB"))
"""Fields of each kind, after the byte with version and kind, and before any data."""


def write(datagram: Datagram) -> bytes:
    kind = KINDS.index(type(datagram))
    fields, data = (datagram, b"") if isinstance(datagram, Answer) else (datagram[:-1], datagram.data)
    return bytes([WIRE_VERSION << 4 | kind]) + LAYOUTS[kind].pack(*fields) + data


def read(datagram: bytes) -> Datagram | None:
    if not 0 < len(datagram) <= MAX_BYTES or datagram[0] >> 4 != WIRE_VERSION or datagram[0] & 15 >= len(KINDS):
        return None
    made, layout = KINDS[datagram[0] & 15], LAYOUTS[datagram[0] & 15]
    if len(datagram) < 1 + layout.size:
        return None
    data = [] if made is Answer else [datagram[1 + layout.size :]]
    return made(*layout.unpack_from(datagram, 1), *data)


def other_version(datagram: bytes) -> int | None:
    """Return the version of a description in another version of the format, if recognisable; otherwise None."""
    version, kind = divmod(datagram[0], 16) if datagram else (0, 0)
    if kind or version in (0, WIRE_VERSION):
        return None
    try:
        return version if zlib.decompressobj(RAW_BITS).decompress(datagram[4:], 1) == b"[" else None
    except zlib.error:
        return None


def describe(forest: Forest, terms: Terms) -> bytes:
    """Return the packed bodies and terms."""
    bodies, digits = [], max(3 - math.floor(math.log10(terms.tolerance)), 6)
    for body in forest.bodies:
        names = [own.encode(errors="replace").decode() for own in (body.name, *body.joints)]
        rest = np.concatenate((body.rest.positions.round(digits), body.rest.quaternions.round(4)), axis=1)
        columns = (body.parents, np.asarray(body.sliding, dtype=int), rest)
        bodies.append((np.asarray(body.radius).round(6).tolist(), names, *(column.tolist() for column in columns)))
    return zlib.compress(json.dumps((*terms, bodies), separators=(",", ":")).encode(), 9, RAW_BITS)


def read_description(data: bytes) -> tuple[Forest, Terms] | None:
    """Return the bodies and terms of a description, or None."""
    try:
        tolerance, delay, grid, bodies = json.loads(zlib.decompressobj(RAW_BITS).decompress(data, MOST_DESCRIBED))
        terms, forest = Terms(float(tolerance), int(delay), int(grid)), Forest([_body(*body) for body in bodies])
        are_sound = MIN_LENGTH_M <= terms.tolerance < MAX_LENGTH_M and all(
            0 < ticks <= LONGEST_DELAY for ticks in terms[1:]
        )
        return (forest, terms) if are_sound else None
    except (zlib.error, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        return None


def _body(radii: list[float], names: list[str], parents: object, sliding: object, rest: object) -> StreamBody:
    """Return a body from its description. Raises various errors if it is invalid."""
    for name in names:
        name.encode()
    rows = np.array(rest, dtype=np.float64)
    above, slides = np.array(parents, dtype=np.int64), np.array(sliding, dtype=bool)
    return StreamBody(names[0], tuple(names[1:]), above, Poses(rows[:, :3], rows[:, 3:]), np.array(radii), slides)
