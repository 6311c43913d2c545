"""Residuals as symbols: which table each whole number of a message is coded by, of what both sides know by then.

A group is the three numbers of a joint at a knot: a turn, or a slide. Groups come knot by knot, the last knot first,
then those within; in each knot joint by joint. Whole numbers alone decide about tables. Encoder,
decoder and the counting for training go through the same function.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log2
from typing import Protocol

from .bodies import Forest
from .coding import Decoder, Encoder

NEAR, FAR, STALE, UNKNOWN, MIDDLE, FINER, STILL = range(7)
"""Kinds of knots. The end of a window is coded against how the message before it goes on, or one before that; against
an old pose; against rest. Then come the first knot within, the others; and those behind an old pose or rest."""

KINDS = 7

LARGEST = 14
"""Magnitudes from here on are written in full."""

MOST_BITS = 20
"""Of a magnitude that is written in full."""

HISTORIES, NEIGHBOURS, SIZES = 8, 5, 6

FULL = 16
"""What a magnitude counts in what is remembered of a joint."""


def bucket(value: int, most: int) -> int:
    """0, 1, 2, 3 to 4, 5 to 8, ...: a number in few classes."""
    return min((value - 1).bit_length() + 1 if value > 0 else 0, most - 1)


class Coder(Protocol):
    """What a number goes through: it is written and returned, or read."""

    def symbol(self, table: int, value: int) -> int: ...

    def flat(self, value: int, count: int) -> int: ...


def flag_table(kind: int, slide: int, history: int, neighbour: int) -> int:
    """Return the number of the table that says whether a group is anything but zeros."""
    return ((kind * 2 + slide) * HISTORIES + history) * NEIGHBOURS + neighbour


FLAGS = KINDS * 2 * HISTORIES * NEIGHBOURS


def size_table(kind: int, slide: int, history: int, size: int) -> int:
    """Return the number of the table of a magnitude."""
    return FLAGS + ((kind * 2 + slide) * HISTORIES + history) * SIZES + size


KNOT_COUNTS = FLAGS + KINDS * 2 * HISTORIES * SIZES
"""The number of the table of how many knots a window has besides its end."""

MOST_KNOTS = 16
"""Of a window."""

MOST_GROUPS = 4096
"""Of all knots of a message together, unless the end alone has more: so much work a datagram can make."""

TABLES = KNOT_COUNTS + 1


def symbols_of(table: int) -> int:
    """How many symbols a table has."""
    return 2 if table < FLAGS else LARGEST + 1 if table < KNOT_COUNTS else MOST_KNOTS


Groups = list[list[list[int]]]
"""Of each knot and each group three numbers."""


class Walk:
    """The order of the groups of a forest."""

    def __init__(self, forest: Forest) -> None:
        self.joints: list[int] = []
        """The joint of each group."""
        self.slides: list[int] = []
        """1 for a slide, 0 for a turn."""
        self.above: list[int] = []
        """The group of the same kind of the joint's parent, or -1."""
        numbers: dict[tuple[int, int], int] = {}
        for joint, (parent, sliding) in enumerate(zip(forest.parents.tolist(), forest.sliding.tolist(), strict=True)):
            for slide in range(1 + sliding):
                numbers[joint, slide] = len(self.joints)
                self.joints.append(joint)
                self.slides.append(slide)
                self.above.append(numbers.get((parent, slide), numbers.get((parent, 0), -1)))

    def __len__(self) -> int:
        return len(self.joints)

    def through(self, coder: Coder, groups: Groups, kind: int, memory: Sequence[int]) -> list[int]:
        """Write or read the groups of a message, and return what is remembered of each group.

        Parameters
        ----------
        coder : Coder
        groups : list
            Of each knot and group three numbers; overwritten by what is read.
        kind : int
            Of the last knot.
        memory : sequence of int
            What is remembered of each group with the pose that the message is coded against.
        """
        last = groups[0]
        for number, knot in enumerate(groups):
            if number:
                kind = STILL if kind in (STALE, UNKNOWN, STILL) else MIDDLE if number == 1 else FINER
            above, before = self.above, 0
            sums = [0] * len(knot)
            for group, values in enumerate(knot):
                slide = self.slides[group]
                if number == 0:
                    history = bucket(memory[group] >> 2, HISTORIES)
                else:
                    x, y, z = groups[number - 1][group]
                    coarser = abs(x) + abs(y) + abs(z)
                    ends = last[group]
                    history = bucket(2 * coarser + abs(ends[0]) + abs(ends[1]) + abs(ends[2]), HISTORIES)
                neighbour = (sums[above[group]] if above[group] >= 0 else 0) + before
                table = flag_table(kind, slide, history, bucket(neighbour, NEIGHBOURS))
                if coder.symbol(table, int(values[0] != 0 or values[1] != 0 or values[2] != 0)):
                    sums[group] = _group(coder, values, kind, slide, history)
                else:
                    values[:] = (0, 0, 0)
                before = sums[group]
            if number == 0:
                memory = [(old + FULL * new) >> 1 for old, new in zip(memory, sums, strict=True)]
        return list(memory)


def _group(coder: Coder, values: list[int], kind: int, slide: int, history: int) -> int:
    """Write or read three numbers, and return the sum of their magnitudes."""
    total = 0
    for axis in range(3):
        size = 0 if axis == 0 else 1 + bucket(total if axis == 1 else total >> 1, SIZES - 1)
        table = size_table(kind, slide, history, min(size, SIZES - 1))
        magnitude = coder.symbol(table, min(abs(values[axis]), LARGEST))
        if magnitude == LARGEST:
            rest = abs(values[axis]) - LARGEST
            width = coder.flat(rest.bit_length() if rest > 0 else 0, MOST_BITS + 1)
            magnitude += coder.flat(max(rest, 0), 1 << width)
        negative = coder.flat(int(values[axis] < 0), 2) if magnitude else 0
        values[axis] = -magnitude if negative else magnitude
        total += magnitude
    return min(total, 1 << MOST_BITS)


class Writing:
    """To an encoder."""

    def __init__(self, tables: Sequence[Sequence[int]]) -> None:
        self.encoder, self._tables = Encoder(), tables

    def symbol(self, table: int, value: int) -> int:
        self.encoder.write(value, self._tables[table])
        return value

    def flat(self, value: int, count: int) -> int:
        self.encoder.write_flat(value, count)
        return value


class Reading:
    """From a decoder."""

    def __init__(self, data: bytes, tables: Sequence[Sequence[int]]) -> None:
        self.decoder, self._tables = Decoder(data), tables

    def symbol(self, table: int, value: int) -> int:
        return self.decoder.read(self._tables[table])

    def flat(self, value: int, count: int) -> int:
        return self.decoder.read_flat(count)


class Counting:
    """How often each symbol of each table occurs."""

    def __init__(self, counts: list[list[int]]) -> None:
        self.counts = counts
        self.raw = 0.0
        """Bits that no table is for."""

    def symbol(self, table: int, value: int) -> int:
        self.counts[table][value] += 1
        return value

    def flat(self, value: int, count: int) -> int:
        self.raw += log2(count)
        return value
