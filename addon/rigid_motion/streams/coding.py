"""A range coder: whole numbers in as few bytes as tables say that they are worth.

Integers of 32 bits and nothing else, so that every language decodes the same. After the carry-propagating range coder
of G. N. N. Martin (1979), in the form of LZMA: `low` and `size` say the interval, bytes leave it from the top. Tables
are cumulative frequencies that rise from 0 to `TOTAL`. To write and to read go by the same two methods, so that what is
said is written down once: `symbol` takes a table's number and `flat` how many numbers are as likely; both return the
number, which only an encoder has to be given.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from .tables import TABLES

BITS = 12
TOTAL = 1 << BITS
"""The frequencies of every table add up to this."""

SMALLEST = 1 << 24
"""Below this the interval is widened by a byte."""

MASK = 0xFFFFFFFF


class Encoder:
    """Numbers to bytes."""

    def __init__(self, tables: Sequence[Sequence[int]] = TABLES) -> None:
        self._tables = tables
        self._low = self._shifted = 0
        """The lower end of the interval, all bytes of it; by how many it was shifted."""
        self._size = MASK

    def symbol(self, table: int, value: int) -> int:
        own = self._tables[table]
        self._narrow(self._size >> BITS, own[value], own[value + 1])
        return value

    def flat(self, count: int, value: int) -> int:
        """Write a number below a count of at most 2^20, all of them as likely."""
        self._narrow(self._size // count, value, value + 1)
        return value

    def _narrow(self, part: int, first: int, last: int) -> None:
        self._low += part * first
        self._size = part * (last - first)
        while self._size < SMALLEST:
            self._size <<= 8
            self._low <<= 8
            self._shifted += 1

    def finish(self) -> bytes:
        """Return the shortest bytes that are read as what was written: what is behind their end counts as zeros."""
        length = self._shifted + 4
        for kept in range(length + 1):
            free = 8 * (length - kept)
            value = -(-self._low >> free) << free
            if value < self._low + self._size:
                return value.to_bytes(length, "big")[:kept].rstrip(b"\0")
        raise AssertionError("an interval of a range coder is never empty")


class Decoder:
    """Bytes to numbers. Any bytes are some numbers: nothing is raised, and nothing read beyond the end but zeros."""

    def __init__(self, data: bytes, tables: Sequence[Sequence[int]] = TABLES) -> None:
        self._data, self._at, self._tables = data, 4, tables
        self._size = MASK
        self._value = int.from_bytes(data[:4].ljust(4, b"\0"), "big")
        """How far what was written is above the lower end of the interval."""

    def symbol(self, table: int, _value: int = 0) -> int:
        own, part = self._tables[table], self._size >> BITS
        read = bisect_right(own, self._share(part, TOTAL)) - 1
        self._narrow(part, own[read], own[read + 1])
        return read

    def flat(self, count: int, _value: int = 0) -> int:
        part = self._size // count
        read = self._share(part, count)
        self._narrow(part, read, read + 1)
        return read

    def _share(self, part: int, count: int) -> int:
        """Return in which part of the interval the value is: beyond the last are only bytes that no encoder wrote."""
        self._value = min(self._value, part * count - 1)
        return self._value // part

    def _narrow(self, part: int, first: int, last: int) -> None:
        self._value -= part * first
        self._size = part * (last - first)
        while self._size < SMALLEST:
            self._size <<= 8
            byte = self._data[self._at] if self._at < len(self._data) else 0
            self._value = (self._value << 8) | byte
            self._at += 1
