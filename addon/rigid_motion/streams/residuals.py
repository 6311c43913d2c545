"""Residuals as symbols: which table each whole number of a message is coded by, of what both sides know by then.

A group is the three numbers of a joint at a knot: a turn, or a slide. Groups come knot by knot, the last knot first,
then those within; in each knot joint by joint. Whole numbers alone decide about tables. Encoder,
decoder and the counting for training go through the same function.
"""

from __future__ import annotations

from collections.abc import Sequence

from .bodies import Forest
from .coding import Decoder, Encoder

NEAR, FAR, STALE, UNKNOWN, MIDDLE, FINER, STILL = range(7)
"""Kinds of knots. The end of a window is coded against how the message before it goes on, or one before that; against
an old pose; against rest. Then come the first knot within, the others; and those behind an old pose or rest."""

LARGEST, MOST_BITS = 14, 20
"""Magnitudes from the first on are written in full, in so many bits at most."""

HISTORIES, NEIGHBOURS, SIZES = 8, 5, 6

FLAGS = 7 * 2 * HISTORIES * NEIGHBOURS
"""Tables that say, for each kind of knot, turns and slides, whether a group is anything but zeros."""

KNOT_COUNTS = FLAGS + 7 * 2 * HISTORIES * SIZES
"""The number of the table of how many knots a window has besides its end, behind those of magnitudes."""

WIDTHS, FINENESS = KNOT_COUNTS + 1, KNOT_COUNTS + 2
"""The numbers of the tables of how many binary digits what is above `LARGEST` has; and of how fine steps are, for rigid
bodies alone, and in the next table where joints hang on others."""

FINEST = 3
"""Steps are halved so many times at most."""

COUNT = FINENESS + 2
"""Of all tables."""

MOST_KNOTS = 16
"""Of a window."""

MOST_GROUPS = 4096
"""Of all knots of a message together, unless the end alone has more: so much work a datagram can make."""

Groups = list[list[list[int]]]
"""Of each knot and each group three numbers."""


def bucket(value: int, most: int) -> int:
    """0, 1, 2, 3 to 4, 5 to 8, ...: a number in few classes."""
    return min((value - 1).bit_length() + 1 if value > 0 else 0, most - 1)


def symbols_of(table: int) -> int:
    """How many symbols a table has."""
    if table >= FINENESS:
        return FINEST + 1
    return {KNOT_COUNTS: MOST_KNOTS, WIDTHS: MOST_BITS + 1}.get(table, 2 if table < FLAGS else LARGEST + 1)


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

    def through(self, coder: Encoder | Decoder, groups: Groups, kind: int, memory: Sequence[int]) -> list[int]:
        """Write or read the groups of a message, and return what is remembered of each group.

        Parameters
        ----------
        coder : Encoder or Decoder
        groups : list
            Of each knot and group three numbers; overwritten by what is read.
        kind : int
            Of the last knot.
        memory : sequence of int
            What is remembered of each group with the pose that the message is coded against.
        """
        sums: list[list[int]] = []
        for number, knot in enumerate(groups):
            if number:
                kind = STILL if kind in (STALE, UNKNOWN, STILL) else MIDDLE if number == 1 else FINER
                weights = [2 * before + end for before, end in zip(sums[-1], sums[0], strict=True)]
            else:
                weights = [old >> 2 for old in memory]
            own = [0] * len(knot)
            before = 0
            for group, values in enumerate(knot):
                of_kind = (kind * 2 + self.slides[group]) * HISTORIES + bucket(weights[group], HISTORIES)
                neighbour = (own[self.above[group]] if self.above[group] >= 0 else 0) + before
                table = of_kind * NEIGHBOURS + bucket(neighbour, NEIGHBOURS)
                if coder.symbol(table, int(any(values))):
                    own[group] = _group(coder, values, FLAGS + of_kind * SIZES)
                else:
                    values[:] = (0, 0, 0)
                before = own[group]
            sums.append(own)
        return [(old + 16 * new) >> 1 for old, new in zip(memory, sums[0], strict=True)]


def _group(coder: Encoder | Decoder, values: list[int], first_table: int) -> int:
    """Write or read three numbers, and return the sum of their magnitudes."""
    total = 0
    for axis in range(3):
        size = 0 if axis == 0 else min(1 + bucket(total >> (axis - 1), SIZES - 1), SIZES - 1)
        magnitude = coder.symbol(first_table + size, min(abs(values[axis]), LARGEST))
        if magnitude == LARGEST:
            rest = max(abs(values[axis]) - LARGEST, 0)
            width = coder.symbol(WIDTHS, rest.bit_length())
            magnitude += coder.flat(1 << width, rest)
        negative = coder.flat(2, int(values[axis] < 0)) if magnitude else 0
        values[axis] = -magnitude if negative else magnitude
        total += magnitude
    return min(total, 1 << MOST_BITS)
