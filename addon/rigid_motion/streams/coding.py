"""A range coder: whole numbers in as few bytes as tables say that they are worth.

Integers of 32 bits and nothing else, so that every language decodes the same. After the carry-propagating range coder
of G. N. N. Martin (1979), in the form of LZMA: `low` and `size` say the interval, bytes leave it from the top. Tables
are cumulative frequencies that rise from 0 to `TOTAL`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

BITS = 12
TOTAL = 1 << BITS
"""The frequencies of every table add up to this."""

SMALLEST = 1 << 24
"""Below this the interval is widened by a byte."""

MASK = 0xFFFFFFFF


class Encoder:
    """Numbers to bytes."""

    def __init__(self) -> None:
        self._low = 0
        """The lower end of the interval, all bytes of it."""
        self._size = MASK
        self._shifted = 0
        """By how many bytes."""

    def write(self, symbol: int, table: Sequence[int]) -> None:
        """Write a symbol, of a table of cumulative frequencies."""
        part = self._size >> BITS
        self._low += part * table[symbol]
        self._size = part * (table[symbol + 1] - table[symbol])
        while self._size < SMALLEST:
            self._size <<= 8
            self._low <<= 8
            self._shifted += 1

    def write_flat(self, value: int, count: int) -> None:
        """Write a number below a count of at most 2^20, all of them as likely."""
        part = self._size // count
        self._low += part * value
        self._size = part
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

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 4
        self._size = MASK
        self._value = int.from_bytes(data[:4].ljust(4, b"\0"), "big")
        """How far what was written is above the lower end of the interval."""

    def read(self, table: Sequence[int]) -> int:
        """Return a symbol, of a table of cumulative frequencies."""
        part = self._size >> BITS
        # Only bytes that no encoder wrote are beyond the last part.
        self._value = min(self._value, (part << BITS) - 1)
        symbol = bisect_right(table, self._value // part) - 1
        self._value -= part * table[symbol]
        self._size = part * (table[symbol + 1] - table[symbol])
        self._widen()
        return symbol

    def read_flat(self, count: int) -> int:
        """Return a number below a count, all of them as likely."""
        part = self._size // count
        self._value = min(self._value, part * count - 1)
        value = self._value // part
        self._value -= part * value
        self._size = part
        self._widen()
        return value

    def _widen(self) -> None:
        while self._size < SMALLEST:
            self._size <<= 8
            byte = self._data[self._at] if self._at < len(self._data) else 0
            self._value = (self._value << 8) | byte
            self._at += 1
