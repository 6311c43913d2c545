"""Rows of samples: which of them vary, and signs that go from one to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .components import PART_OF, REST, ROTATION
from .sources import Source

NOTHING = 1e-9
"""What a component varies by that is always the same but for rounding errors."""


def align(quaternions: np.ndarray, starts: Sequence[int]) -> None:
    """Take quaternions (4, m) with that sign in which they are nearer to the one before, from each of the starts on.

    On a key the difference is the same rotation as between keys, but where the channels have gone the long way round
    not the same quaternion: straight from one to the other it would pass zero.
    """
    turned = np.einsum("km,km->m", quaternions[:, 1:], quaternions[:, :-1]) < 0.0
    turned[[start - 1 for start in starts if start]] = False
    if turned.any():
        flips = np.concatenate(((0,), np.cumsum(turned)))
        lengths = np.diff((*starts, quaternions.shape[1]))
        odd = (flips - np.repeat(flips[list(starts)], lengths)) % 2 == 1
        np.negative(quaternions, out=quaternions, where=odd)


def held_rows(source: Source, changing: set[int], constant: np.ndarray) -> set[int]:
    """The rows that never change, and have to be held all the same, of what is constant (.,) in them.

    The components of a quaternion are one by one only where they are zero. In the NLA Blender puts what a strip has no
    channel of to its default.
    """
    turning = source.order is None and any(PART_OF[row] == ROTATION for row in changing)
    default = REST if source.order is None else np.where((REST == 1.0) & (np.arange(10) == 3), 0.0, REST)
    return {
        row
        for row in source.filled_rows
        if row not in changing
        and (
            (turning and PART_OF[row] == ROTATION and abs(constant[row]) > NOTHING)
            or (source.in_nla and abs(constant[row] - default[row]) > NOTHING)
        )
    }


def range_of_each(rows: np.ndarray, starts: Sequence[int]) -> np.ndarray:
    """By how much rows (r, m) vary within each of the parts that start there, shape (r, parts)."""
    return np.maximum.reduceat(rows, starts, axis=1) - np.minimum.reduceat(rows, starts, axis=1)
