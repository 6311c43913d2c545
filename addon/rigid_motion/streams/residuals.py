"""Residuals as symbols: which table each whole number of a message is coded by, of what both sides know by then.

A group is the three numbers of a joint at a knot: a turn, or a slide. Groups come knot by knot, the last knot first,
then those within; in each knot joint by joint. Whole numbers alone decide about tables.
"""

from __future__ import annotations

from collections.abc import Sequence

from .bodies import Forest
from .coding import Coder

NEAR, FAR, STALE, UNKNOWN, MIDDLE, FINER, STILL = range(7)
"""Kinds of knots. The end of a window is coded against how the message before it goes on, or one before that; against
an old pose; against rest. Then come the first knot within, the others; and those behind an old pose or rest."""

LARGEST, MOST_BITS = 14, 20
"""Magnitudes from the first on are written in full, in so many bits at most."""

HISTORIES, NEIGHBOURS, SIZES = 8, 5, 6

FLAGS = 7 * 2 * HISTORIES * NEIGHBOURS
"""Tables that say, for each kind of knot, turns and slides, whether a group is anything but zeros. Behind them are
those of magnitudes, and then single ones:"""

KNOT_COUNTS = FLAGS + 7 * 2 * HISTORIES * SIZES
WIDTHS, FINENESS, BASES, ODD, LATES = (KNOT_COUNTS + number for number in (1, 2, 4, 5, 6))
"""How many knots a window has besides its end; how many binary digits what is above `LARGEST` has; how fine steps are,
of rigid bodies alone, and in the next table where joints hang on others; what a message builds on; whether its end is
between two moments of the grid; and whether it is late."""

FINEST, MOST_KNOTS = 3, 16
"""So many times steps are halved at most; and knots of a window."""

MOST_GROUPS = 4096
"""Of all knots of a message together, unless the end alone has more: so much work a datagram can make."""

SYMBOLS = {KNOT_COUNTS: MOST_KNOTS, WIDTHS: MOST_BITS + 1, FINENESS: 4, FINENESS + 1: 4, BASES: 3, ODD: 2, LATES: 3}
COUNT = KNOT_COUNTS + len(SYMBOLS)
"""Of all tables."""

Groups = list[list[list[int]]]
"""Of each knot and each group three numbers."""


def bucket(value: int, most: int) -> int:
    """0, 1, 2, 3 to 4, 5 to 8, ...: a number in few classes."""
    return min((value - 1).bit_length() + 1 if value > 0 else 0, most - 1)


def symbols_of(table: int) -> int:
    """How many symbols a table has."""
    return SYMBOLS.get(table, 2 if table < FLAGS else LARGEST + 1)


def code(coder: Coder, forest: Forest, groups: Groups, kind: int, memory: Sequence[int]) -> tuple[int, ...]:
    """Write or read the groups of a message, and return what is remembered of each group.

    They are of each knot and group three numbers, which what is read overwrites. `kind` is that of the last knot, and
    `memory` what is remembered of each group with the pose that the message is coded against.
    """
    sums: list[list[int]] = []
    for number, knot in enumerate(groups):
        if number:
            kind = STILL if kind in (STALE, UNKNOWN, STILL) else MIDDLE if number == 1 else FINER
            weights = [2 * before + end for before, end in zip(sums[-1], sums[0], strict=True)]
        else:
            weights = [old >> 2 for old in memory]
        own: list[int] = []
        for values, weight, (_, slide, above) in zip(knot, weights, forest.groups, strict=True):
            of_kind = (kind * 2 + slide) * HISTORIES + bucket(weight, HISTORIES)
            neighbour = (own[above] if above >= 0 else 0) + (own[-1] if own else 0)
            if coder.symbol(of_kind * NEIGHBOURS + bucket(neighbour, NEIGHBOURS), int(any(values))):
                own.append(_code_group(coder, values, FLAGS + of_kind * SIZES))
            else:
                values[:] = (0, 0, 0)
                own.append(0)
        sums.append(own)
    return tuple((old + 16 * new) >> 1 for old, new in zip(memory, sums[0], strict=True))


def _code_group(coder: Coder, values: list[int], first_table: int) -> int:
    """Write or read three numbers, and return the sum of their magnitudes."""
    total = 0
    for axis in range(3):
        size = 0 if axis == 0 else min(1 + bucket(total >> (axis - 1), SIZES - 1), SIZES - 1)
        magnitude = coder.symbol(first_table + size, min(abs(values[axis]), LARGEST))
        if magnitude == LARGEST:
            rest = max(abs(values[axis]) - LARGEST, 0)
            magnitude += coder.flat(1 << coder.symbol(WIDTHS, rest.bit_length()), rest)
        negative = coder.flat(2, int(values[axis] < 0)) if magnitude else 0
        values[axis] = -magnitude if negative else magnitude
        total += magnitude
    return min(total, 1 << MOST_BITS)
