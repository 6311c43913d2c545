"""Rows of samples: which of them vary."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .components import PART_OF, REST, ROTATION
from .sources import Source

NOTHING = 1e-9
"""A component that varies by less is always the same but for rounding errors."""


def kept_rows(sources: Sequence[Source], first: np.ndarray, ranges: np.ndarray) -> list[list[int]]:
    """Return the rows that each source has samples of, in which these are at first and vary by this much,
    (., sources).
    """
    kept = []
    for source, constant, varies in zip(sources, first.T, (ranges > NOTHING).T.tolist(), strict=True):
        changing = {row for row in source.filled_rows if varies[row]}
        kept.append(sorted(changing | _held_rows(source, changing, constant)))
    return kept


def _held_rows(source: Source, changing: set[int], constant: np.ndarray) -> set[int]:
    """Return the rows that never change, and have to be held all the same, of what is constant (.,) in them.

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
    """Return by how much rows (r, m) vary within each of the parts that start there, shape (r, parts)."""
    return np.maximum.reduceat(rows, starts, axis=1) - np.minimum.reduceat(rows, starts, axis=1)
