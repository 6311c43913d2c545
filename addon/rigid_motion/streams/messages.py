"""Messages: what their whole numbers are in metres and radians, what the next one builds on, and their bytes.

A message says the poses of all joints at the end of a window, and at moments within it where that is not enough. The
end is coded against what the motion did so far, each other knot against the straight way between those around it that
were said before. Residuals of a turn are a rotation vector in the joint's own axes, those of a slide are in its
parent's space; both are counted in steps.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import normalise, turned, turns_between
from .bodies import Forest
from .coding import BASES, FAR, FINENESS, KNOT_COUNTS, MOST_GROUPS, NEAR, ODD, STALE, UNKNOWN, Coder, code
from .paths import Path
from .wire import TICKS, Terms

OLD = TICKS // 2
"""Ticks after which a pose says nothing any more about how the motion goes on."""

MOST_BACK, FURTHEST = 129, 3 * TICKS
"""What a message builds on is so many messages before it at most, and its end so many ticks."""

TURN_STEP, SLIDE_STEP = 1.0, 0.5
"""Steps, in tolerances: at the end of what hangs on a joint, and of its place."""

NOWHERE = 1e5
"""Metres from the middle of everything at which nothing is any more."""


class Codec:
    """Messages of a forest: their steps, to bytes and back."""

    def __init__(self, forest: Forest, terms: Terms) -> None:
        self.forest, self.terms = forest, terms
        self.tolerance = terms.tolerance
        slides = np.array([slide for _, slide, _ in forest.groups], dtype=bool)
        self._turns, self._slides = np.flatnonzero(~slides), np.flatnonzero(slides)
        """The groups of each kind: all joints turn."""
        self.turn_steps = TURN_STEP * self.tolerance / forest.reaches
        self.slide_step = SLIDE_STEP * self.tolerance
        self._fineness = FINENESS + bool((forest.parents >= 0).any())
        self.rest = Message(self)
        """What is known before any message."""

    def moved(self, poses: Poses, numbers: np.ndarray, factor: float) -> Poses:
        """Return poses (joints,) moved by whole numbers (groups, 3), in steps times a factor."""
        places, turns = poses.positions.copy(), numbers[self._turns] * (self.turn_steps * factor)[:, None]
        places[self.forest.sliding] += numbers[self._slides] * (self.slide_step * factor)
        return Poses(places, turned(poses.quaternions, turns))

    def rounded(self, poses: Poses, desired: Poses, factor: float) -> np.ndarray:
        """Return the whole numbers (groups, 3) that move poses (joints,) nearest to others."""
        slides = (desired.positions - poses.positions) / (self.slide_step * factor)
        turns = turns_between(poses.quaternions, desired.quaternions) / (self.turn_steps * factor)[:, None]
        numbers = np.zeros((len(self.forest.groups), 3), dtype=np.int64)
        numbers[self._slides], numbers[self._turns] = np.rint(slides[self.forest.sliding]), np.rint(turns)
        return numbers

    def write(self, message: Message, base: Message | None) -> bytes:
        """Return the bytes of a message."""
        coder = Coder()
        self.code(coder, lambda _: base, message)
        return coder.finish()

    def code(
        self, coder: Coder, known: Callable[[int], Message | None], message: Message | None = None
    ) -> Message | None:
        """Write a message, or read one where none is given.

        `known` has the message so many before it. None for what nobody can have written, or what builds on something
        that is not known.
        """
        terms, size, said = self.terms, len(self.forest.groups), message or self.rest
        back = coder.symbol(BASES, min(said.back, 2))
        if back == 2:
            back += coder.flat(MOST_BACK - 1, said.back - 2)
        base = known(back) if back else self.rest
        if base is None:
            return None
        if back:
            whole, odd = divmod(said.end - base.end, terms.grid)
            end = base.end + terms.grid * coder.flat(FURTHEST // terms.grid + 1, whole)
            end += coder.flat(terms.grid, odd) if coder.symbol(ODD, int(odd > 0)) else 0
        else:
            end = coder.digits(48, said.end)
            end -= end >> 47 << 48  # of either sign
        finer = coder.symbol(self._fineness, said.finer)
        inner = coder.symbol(KNOT_COUNTS, len(said.cells) - 1)
        most_cells = (terms.delay - 1) // terms.grid
        if (inner + 1) * size > max(MOST_GROUPS, size) or inner > most_cells:
            return None
        cells = [1 + coder.flat(most_cells, cell - 1) for cell in said.cells[1:] or [1] * inner]
        if len(set(cells)) < inner:
            return None
        groups = [own.tolist() for own in said.numbers] or [[[0, 0, 0] for _ in range(size)] for _ in range(inner + 1)]
        read = message or Message(self, base, back, end, finer)
        read.memory = code(coder, self.forest, groups, read.kind, base.memory)
        if message is None:
            for cell, numbers in zip([0, *cells], groups, strict=True):
                read.say(cell, np.array(numbers))
        return read if read.is_somewhere else None


class Message:
    """What a message says of a window: the poses at its knots, the end first, then others between those that are there.

    It builds on `base`, which is so many messages `back`, 0 for what is known before any; its window ends at the tick
    `end`, and steps are halved `finer` times. Others can build on it.
    """

    def __init__(self, codec: Codec, base: Message | None = None, back: int = 0, end: int = 0, finer: int = 0) -> None:
        self._codec, self.back, self.end, self.finer = codec, back, end, finer
        self.factor = 0.5**finer
        """Of the steps."""
        self.kind, self._goes_on = UNKNOWN, False
        """How the end is coded, a kind of `coding`; and whether that is against what the motion did so far."""
        self.cells: list[int] = []
        """Of each knot, in the order in which they came, how many cells of the grid it is before the end."""
        self.supports: list[tuple[float, float, float]] = []
        """Of each the moments between which it has a say, its own in between."""
        self.numbers: list[np.ndarray] = []
        """Of each the whole numbers (groups, 3)."""
        self.memory: tuple[int, ...] = (0,) * len(codec.forest.groups)
        """How large the residuals of each group were."""
        self.path = Path(np.zeros(1), codec.forest.rest[:, None])
        """From the start of the window to its end: what the motion would do if nothing new came, until that is said."""
        if base:
            moments = np.array((end - codec.terms.delay, end)) / TICKS
            if back:
                self.kind = STALE if end - base.end > OLD else NEAR if back == 1 else FAR
                self._goes_on = self.kind in (NEAR, FAR)
            self.path = Path(moments, base.path.at(moments) if self._goes_on else base.path.poses[:, [-1, -1]])

    @property
    def is_somewhere(self) -> bool:
        """Return whether it puts all joints where something can be; otherwise nobody reads it."""
        return bool(np.abs(self.path.poses.positions).max() < NOWHERE)

    def say(self, cell: int, numbers: np.ndarray | None = None, samples: Path | None = None) -> None:
        """Move the end, which comes first and is cell 0, or else a new knot, by whole numbers (groups, 3).

        Without numbers it is moved as near to what samples have there as these bring it.
        """
        at, moment = 1, (self.end - cell * self._codec.terms.grid) / TICKS
        moments, poses = self.path.moments, self.path.poses
        if cell:
            at = int(np.searchsorted(moments, moment))
            moments = np.insert(moments, at, moment)
            poses = joined((poses[:, :at], self.path.pose(moment)[:, None], poses[:, at:]), axis=1)
        self.cells.append(cell)
        self.supports.append((moments[at - 1], moment, moments[at + 1] if cell else np.inf))
        if numbers is None:
            assert samples is not None
            numbers = self._codec.rounded(poses[:, at], samples.pose(moment), self.factor)
        self.numbers.append(numbers)
        poses[:, at] = self._codec.moved(poses[:, at], numbers, self.factor)
        if not (cell or self._goes_on):
            # How the motion got there is not known.
            poses[:, 0] = poses[:, 1]
        self.path = Path(moments, Poses(poses.positions, normalise(poses.quaternions))).going_on()
