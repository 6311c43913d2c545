"""Stepped modifiers: which frame of a curve is held on a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stepped:
    """A Stepped modifier with full influence: from `start` to `end` every `step` frames, counted from `offset`, hold.

    Without an end on one side that is infinite.
    """

    step: float
    offset: float
    start: float = -np.inf
    end: float = np.inf


def held(steps: Sequence[Stepped], times: np.ndarray) -> np.ndarray:
    """Return the frames whose values a curve with these modifiers, first to last, has at these times (m,).

    In single precision and in Blender's order of steps: it decides on which side of a key a frame falls. Blender rounds
    towards the offset, so before that a hold shows the frame that it ends on.
    """
    if not steps:
        return times
    result = np.asarray(times).astype(np.float32)
    # Blender asks the last one first.
    for item in reversed(steps):
        step, offset = np.float32(item.step), np.float32(item.offset)
        blocks = np.trunc((result - offset) / step)
        result = np.where((result >= item.start) & (result <= item.end), blocks * step + offset, result)
    return result.astype(np.float64)
