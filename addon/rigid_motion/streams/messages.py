"""The payload of a message: how fine its steps are, where its knots are, and the whole numbers of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .knots import FINEST, Scale, State, Window
from .residuals import KNOT_COUNTS, MOST_GROUPS, Coder, Reading, Writing
from .tables import TABLES
from .wire import TICKS, Terms

FURTHEST = 1e5
"""Metres from the middle of everything at which nothing is any more."""


@dataclass(frozen=True)
class Said:
    """What a message says, in whole numbers."""

    finer: int
    """How many times its steps are halved."""

    cells: list[int]
    """Of each knot besides the end, how many cells of the grid it is before the end, in the order of their numbers."""

    groups: list[list[list[int]]]
    """Of each knot, the end first, and each group three numbers."""

    late: int = 0
    """Ticks by which it is sent later than at its end: by so many its window is shorter. Below the delay."""


class Codec:
    """Messages of a forest to bytes and back."""

    def __init__(self, scale: Scale, terms: Terms) -> None:
        self.scale, self.terms = scale, terms

    def write(self, said: Said, kind: int, state: State, is_late: bool) -> tuple[bytes, tuple[int, ...]]:
        """Return the payload, and what the next message remembers."""
        coder = Writing(TABLES)
        through = self.through(coder, said, kind, state, is_late)
        assert through is not None  # what is written can be read
        _, memory = through
        return coder.encoder.finish(), memory

    def read(self, payload: bytes, kind: int, state: State, is_late: bool) -> tuple[Said, tuple[int, ...]] | None:
        """Return what a payload says, and what the next message remembers; None for what nobody can have written."""
        return self.through(Reading(payload, TABLES), Said(0, [], []), kind, state, is_late)

    def through(
        self, coder: Coder, said: Said, kind: int, state: State, is_late: bool
    ) -> tuple[Said, tuple[int, ...]] | None:
        """Write what a message says, or read it in place of what is given."""
        late = coder.flat(said.late, self.terms.delay) if is_late else 0
        finer = coder.flat(said.finer, FINEST + 1)
        inner = coder.symbol(KNOT_COUNTS, len(said.cells))
        size = len(self.scale.walk)
        if (inner + 1) * size > max(MOST_GROUPS, size) or inner > self.terms.cells:
            return None
        given = said.cells or [1] * inner
        cells = [1 + coder.flat(cell - 1, self.terms.cells) for cell in given]
        if len(set(cells)) < inner or max(cells, default=0) * self.terms.grid >= self.terms.delay - late:
            return None
        groups = said.groups or [[[0, 0, 0] for _ in range(size)] for _ in range(inner + 1)]
        memory = self.scale.walk.through(coder, groups, kind, state.memory)
        return Said(finer, cells, groups, late), tuple(memory)

    def window(self, said: Said, state: State, kind: int, end: int) -> Window | None:
        """Return the window of a message that ends at some ticks; None where that is nowhere."""
        terms = self.terms
        window = Window(self.scale, state, kind, (end + said.late - terms.delay) / TICKS, end / TICKS, said.finer)
        numbers = np.array(said.groups, dtype=np.float64)
        window.say(numbers[0])
        for cell, own in zip(said.cells, numbers[1:], strict=True):
            window.say(own, window.insert((end - cell * terms.grid) / TICKS))
        return window if all(np.abs(places).max() < FURTHEST for places in window.positions) else None
