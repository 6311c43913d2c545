"""A range coder: whole numbers in as few bytes as tables say that they are worth.

Integers of 32 bits and nothing else, so that every language decodes the same. After the carry-propagating range coder
of G. N. N. Martin (1979), in the form of LZMA: `low` and `size` say the interval, bytes leave it from the top. Tables
are cumulative frequencies that rise from 0 to `TOTAL`. To write and to read go by the same two methods, so that what is
said is written down once: `symbol` takes a table's number and `flat` how many numbers are as likely; both return the
number, which has to be given only where it is written.
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


class Coder:
    """Numbers to bytes or, where bytes are given, to numbers.

    Any bytes are some numbers: nothing is raised, and nothing read beyond the end but zeros.
    """

    def __init__(self, data: bytes | None = None, tables: Sequence[Sequence[int]] = TABLES) -> None:
        self._tables, self._reads, self._data = tables, data is not None, data or b""
        self._size = (1 << 32) - 1
        self._at = 4 if self._reads else 0
        """The byte that comes next; how many left the interval."""
        self._low = -int.from_bytes(self._data[:4].ljust(4, b"\0"), "big")
        """The lower end of the interval, all bytes of it, less what is read."""

    def symbol(self, table: int, value: int = 0) -> int:
        own, part = self._tables[table], self._size >> BITS
        if self._reads:
            value = bisect_right(own, self._share(part, TOTAL)) - 1
        self._narrow(part, own[value], own[value + 1])
        return value

    def flat(self, count: int, value: int = 0) -> int:
        """Write or read a number below a count of at most 2^20, all of them as likely."""
        part = self._size // count
        if self._reads:
            value = self._share(part, count)
        self._narrow(part, value, value + 1)
        return value

    def _share(self, part: int, count: int) -> int:
        """Return in which part of the interval the value is: beyond the last are only bytes that nobody wrote."""
        self._low = max(self._low, 1 - part * count)
        return -self._low // part

    def _narrow(self, part: int, first: int, last: int) -> None:
        self._low += part * first
        self._size = part * (last - first)
        while self._size < SMALLEST:
            byte = self._data[self._at] if self._at < len(self._data) else 0
            self._low, self._size = (self._low << 8) - byte, self._size << 8
            self._at += 1

    def finish(self) -> bytes:
        """Return the shortest bytes that are read as what was written: what is behind their end counts as zeros."""
        length = self._at + 4
        for kept in range(length + 1):
            free = 8 * (length - kept)
            value = -(-self._low >> free) << free
            if value < self._low + self._size:
                return value.to_bytes(length, "big")[:kept].rstrip(b"\0")
        raise AssertionError("an interval of a range coder is never empty")
