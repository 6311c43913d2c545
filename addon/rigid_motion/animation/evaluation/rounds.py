"""Rounds of channels with Cycles: whether what is added to them repeats along, and rounds without end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fcurves.keys import Keys
from .components import AXIS_ANGLE
from .marks import FULL_TURN, vary

Channels = tuple[tuple[list[int], Keys], ...]
"""Rows among the components, and keys."""


def repeat(channels: Channels, cyclic: Keys, order: str | None) -> bool:
    """Return whether the motion in every round is that in the first, where one of the channels that change is `cyclic`.

    So it is where all of them go round together, and in rounds with an offset turn and grow by nothing, or turn about
    one and the same axis.
    """
    cycles, ends = cyclic.cycles, cyclic.times[[0, -1]].tolist()
    assert cycles is not None
    changing = [(rows, keys) for rows, keys in channels if vary(keys).any()]
    if any(keys.cycles != cycles or keys.times[[0, -1]].tolist() != ends for _, keys in changing):
        return False
    if "REPEAT_OFFSET" not in (cycles.before, cycles.after):
        return True
    change, turning = np.zeros(10), 0
    for rows, keys in changing:
        change[rows] = keys.values[:, -1] - keys.values[:, 0]
        turning += int(np.count_nonzero(vary(keys)[[3 <= row < 7 for row in rows]]))
    if order is not None:
        # Angles of other axes stand still where a single one changes.
        angles = slice(3, 4) if order == AXIS_ANGLE else slice(3, 6)
        change[angles] -= FULL_TURN * np.rint(change[angles] / FULL_TURN) if turning > 1 else change[angles]
    return bool(np.abs(change[3:]).max() < 1e-6)


def endless(channels: Channels) -> Channels:
    """Return channels whose cycles have no end."""
    return tuple(
        (rows, keys if keys.cycles is None else replace(keys, cycles=keys.cycles.endless)) for rows, keys in channels
    )
