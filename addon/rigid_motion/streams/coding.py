"""Entropy coder for messages: converts integers to few bytes and back, using tables of frequencies.

A group is the three numbers of a joint at a knot: a turn, or a slide. Groups come knot by knot, the last knot first,
then the inner ones; in each knot joint by joint. The table for a number depends on what both sides already know.

The coder uses only 32-bit integers, so that every language decodes the same. It follows the carry-propagating range
coder of G. N. N. Martin (1979), in the form of LZMA. `low` and `size` define the interval; bytes leave it from the top.
Tables are cumulative frequencies that rise from 0 to `FREQUENCY_TOTAL`. Writing and reading use the same two methods,
so the format is written down only once: `symbol` takes the number of a table, `flat` the number of equally likely
values. Both return the number, which only has to be given for writing.
"""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

from .bodies import Forest

NEAR_KNOT, FAR_KNOT, STALE_KNOT, UNKNOWN_KNOT, MIDDLE_KNOT, FINER_KNOT, STILL_KNOT = range(7)
"""Kinds of knots. The end of a window is coded against the extrapolated motion of the message before, or of an earlier
one; against an old pose; or against rest. Then the first inner knot, the others, and those after an old or rest
pose."""

FIRST_LONG_MAGNITUDE, LAST_TABLE_BITS, MAX_EXTRA_BITS = 14, 20, 32
"""Magnitudes from the first value on are written in full. The last bit width in the tables stands for itself and for up
to MAX_EXTRA_BITS - 1 more: 2^51 of the finest steps of the smallest tolerance are farther than anything is.
"""

HISTORY_COUNT, NEIGHBOUR_COUNT, SIZE_COUNT = 8, 5, 6

FLAG_TABLE_COUNT = 7 * 2 * HISTORY_COUNT * NEIGHBOUR_COUNT
"""Number of tables that say, for each kind of knot, turns and slides, whether a group is not all zeros. The tables of
magnitudes follow, and then these single ones:"""

KNOT_COUNTS = FLAG_TABLE_COUNT + 7 * 2 * HISTORY_COUNT * SIZE_COUNT
WIDTHS_TABLE, FINENESS_TABLE, BASES_TABLE, ODD_TABLE, HANDS_TABLE = (KNOT_COUNTS + number for number in (1, 2, 4, 5, 6))
"""Tables for: number of inner knots of a window; number of bits above `FIRST_LONG_MAGNITUDE`; fineness of steps, for
rigid bodies only and in the next table for joints with parents; which message this one builds on; whether the end is
between two moments of the grid; and whether holders have changed since the message it builds on."""

MAX_STEP_HALVINGS, MAX_KNOTS = 3, 32
"""Most halvings of steps; and most inner knots of a window."""

MOST_GROUPS = 4096
"""Most groups in all knots of a message, unless the end alone has more: limits the work that a datagram can cause."""

FREQUENCY_BITS = 12
FREQUENCY_TOTAL = 1 << FREQUENCY_BITS
"""The frequencies of every table add up to this."""

MIN_INTERVAL = 1 << 24
"""Smaller intervals are widened by a byte."""

TABLE_FILE = files(__package__) / "tables.json"
"""The tables of this wire version, made by scripts/research/making/stream_tables.py."""


@cache
def standard_tables() -> list[list[int]]:
    """Return the cumulative frequencies of the symbols of each table."""
    return json.loads(TABLE_FILE.read_text(encoding="utf-8"))


class Coder:
    """Encoder from numbers to bytes or, if bytes are given, decoder to numbers.

    Any bytes decode to some numbers: nothing is raised, and beyond the end only zeros are read.
    """

    def __init__(self, data: bytes | None = None, tables: Sequence[Sequence[int]] | None = None) -> None:
        self._tables = standard_tables() if tables is None else tables
        self._reads, self._data = data is not None, data or b""
        self._size = (1 << 32) - 1
        self._at = 4 if self._reads else 0
        """Index of the next byte to read; or number of bytes written."""
        self._low = -int.from_bytes(self._data[:4].ljust(4, b"\0"), "big")
        """The lower end of the interval, in all of its bytes, minus the value read."""

    def symbol(self, table: int, value: int = 0) -> int:
        own, part = self._tables[table], self._size >> FREQUENCY_BITS
        if self._reads:
            value = bisect_right(own, self._share(part, FREQUENCY_TOTAL)) - 1
        self._narrow(part, own[value], own[value + 1])
        return value

    def flat(self, count: int, value: int = 0) -> int:
        """Write or read a number below `count`, at most 2^20, with all numbers equally likely."""
        part = self._size // count
        if self._reads:
            value = self._share(part, count)
        self._narrow(part, value, value + 1)
        return value

    def digits(self, count: int, value: int = 0) -> int:
        """Write or read a number of `count` bits, up to 16 at a time, highest first."""
        read = 0
        for shift in range((count - 1) // 16 * 16, -1, -16):
            read |= self.flat(1 << min(count - shift, 16), value >> shift & 0xFFFF) << shift
        return read

    def _share(self, part: int, count: int) -> int:
        """Return the part of the interval that contains the value; invalid bytes count as the last part."""
        self._low = max(self._low, 1 - part * count)
        return -self._low // part

    def _narrow(self, part: int, first: int, last: int) -> None:
        self._low += part * first
        self._size = part * (last - first)
        while self._size < MIN_INTERVAL:
            byte = self._data[self._at] if self._at < len(self._data) else 0
            self._low, self._size = (self._low << 8) - byte, self._size << 8
            self._at += 1

    def finish(self) -> bytes:
        """Return the shortest bytes that decode to the written numbers: bytes after their end count as zeros."""
        length = self._at + 4
        for kept in range(length + 1):
            free = 8 * (length - kept)
            value = -(-self._low >> free) << free
            if value < self._low + self._size:
                return value.to_bytes(length, "big")[:kept].rstrip(b"\0")
        raise AssertionError("an interval of a range coder is never empty")


def bucket(value: int, most: int) -> int:
    """Return the class of a number, of `most` classes: 0, 1, 2, 3 to 4, 5 to 8 and so on."""
    return min((value - 1).bit_length() + 1 if value > 0 else 0, most - 1)


def code(
    coder: Coder, forest: Forest, groups: list[list[list[int]]], kind: int, memory: Sequence[int]
) -> tuple[int, ...]:
    """Write or read the groups of a message, and return the new memory of each group.

    `groups` has three numbers for each knot and group, which reading overwrites. `kind` is that of the last knot, and
    `memory` the memory of each group with the pose that the message is coded against.
    """
    sums: list[list[int]] = []
    for number, knot in enumerate(groups):
        if number:
            kind = (
                STILL_KNOT
                if kind in (STALE_KNOT, UNKNOWN_KNOT, STILL_KNOT)
                else MIDDLE_KNOT
                if number == 1
                else FINER_KNOT
            )
            weights = [2 * before + end for before, end in zip(sums[-1], sums[0], strict=True)]
        else:
            weights = [old >> 2 for old in memory]
        own: list[int] = []
        for values, weight, (_, slide, above) in zip(knot, weights, forest.groups, strict=True):
            of_kind = (kind * 2 + slide) * HISTORY_COUNT + bucket(weight, HISTORY_COUNT)
            neighbour = (own[above] if above >= 0 else 0) + (own[-1] if own else 0)
            if coder.symbol(of_kind * NEIGHBOUR_COUNT + bucket(neighbour, NEIGHBOUR_COUNT), int(any(values))):
                own.append(_code_group(coder, values, FLAG_TABLE_COUNT + of_kind * SIZE_COUNT))
            else:
                values[:] = (0, 0, 0)
                own.append(0)
        sums.append(own)
    return tuple((old + 16 * new) >> 1 for old, new in zip(memory, sums[0], strict=True))


def _code_group(coder: Coder, values: list[int], first_table: int) -> int:
    """Write or read three numbers, and return the sum of their magnitudes."""
    total = 0
    for axis in range(3):
        size = 0 if axis == 0 else min(1 + bucket(total >> (axis - 1), SIZE_COUNT - 1), SIZE_COUNT - 1)
        magnitude = coder.symbol(first_table + size, min(abs(values[axis]), FIRST_LONG_MAGNITUDE))
        if magnitude == FIRST_LONG_MAGNITUDE:
            rest = max(abs(values[axis]) - FIRST_LONG_MAGNITUDE, 0)
            width = coder.symbol(WIDTHS_TABLE, min(rest.bit_length(), LAST_TABLE_BITS))
            width += coder.flat(MAX_EXTRA_BITS, rest.bit_length() - LAST_TABLE_BITS) if width == LAST_TABLE_BITS else 0
            magnitude += coder.digits(width, rest)
        negative = coder.flat(2, int(values[axis] < 0)) if magnitude else 0
        values[axis] = -magnitude if negative else magnitude
        total += magnitude
    return min(total, 1 << LAST_TABLE_BITS)
