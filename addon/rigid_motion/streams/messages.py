"""Messages: what their whole numbers are in metres and radians, what the next one builds on, and their bytes.

A message says the poses of all joints at the end of a window, and at moments within it where that is not enough. The
end is coded against what the motion did so far, each other knot against the straight way between those around it that
were said before. Residuals of a turn are a rotation vector in the joint's own axes, those of a slide are in its
parent's space; both are counted in steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import normalise, turned, turns_between
from .bodies import Forest
from .coding import Coder
from .paths import Path
from .residuals import BASES, FAR, FINENESS, KNOT_COUNTS, LATES, MOST_GROUPS, NEAR, ODD, STALE, UNKNOWN, Groups, code
from .wire import TICKS, Terms

OLD = TICKS // 2
"""Ticks after which a pose says nothing any more about how the motion goes on."""

MOST_BACK, FURTHEST = 129, 3 * TICKS
"""What a message builds on is so many messages before it at most, and its end so many ticks."""

TURN_STEP, SLIDE_STEP = 1.0, 0.5
"""Steps, in tolerances: at the end of what hangs on a joint, and of its place."""

NOWHERE = 1e5
"""Metres from the middle of everything at which nothing is any more."""


@dataclass(frozen=True, eq=False)
class State:
    """What both sides know of a message, which others build on: the path from the start of its window to the end, how
    large the residuals of each group were, and the ticks of the end.
    """

    path: Path
    memory: tuple[int, ...]
    end: int


class Said(NamedTuple):
    """What a message says, in whole numbers.

    The message that it builds on is `back` before it, 0 for nothing; its window ends at the tick `end`. Where it is
    sent later than at the end, `late` is 1 and the ticks by which its window is shorter. Steps are halved `finer`
    times. Of each knot besides the end, `cells` is how many cells of the grid it is before the end, in the order of
    their numbers; `groups` are those, of each knot, the end first, and each group three.
    """

    back: int
    end: int
    late: int = 0
    finer: int = 0
    cells: Sequence[int] = ()
    groups: Groups | tuple[()] = ()

    def window(self, terms: Terms) -> tuple[float, float]:
        """Return the start and the end of the window, in seconds."""
        return (self.end + max(self.late - 1, 0) - terms.delay) / TICKS, self.end / TICKS

    def kind(self, base: State) -> int:
        """How its end is coded against what it builds on, a kind of `residuals`."""
        if not self.back:
            return UNKNOWN
        return STALE if self.end - base.end > OLD else NEAR if self.back == 1 else FAR


UNSAID = Said(0, 0)


class Codec:
    """Messages of a forest: their steps, to bytes and back."""

    def __init__(self, forest: Forest, terms: Terms) -> None:
        self.forest, self.terms = forest, terms
        self.tolerance = terms.tolerance / 1e6
        slides = np.array([slide for _, slide, _ in forest.groups], dtype=bool)
        self._turns, self._slides = np.flatnonzero(~slides), np.flatnonzero(slides)
        """The groups of each kind: all joints turn."""
        self.turn_steps = TURN_STEP * self.tolerance / forest.reaches
        self.slide_step = SLIDE_STEP * self.tolerance
        self._fineness = FINENESS + bool((forest.parents >= 0).any())
        self.rest = State(Path(np.zeros(1), forest.rest[:, None]), (0,) * len(slides), 0)
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

    def write(self, said: Said, base: State | None) -> tuple[bytes, State]:
        """Return the bytes of a message, and what the next one can build on."""
        coder = Coder()
        coded = self.code(coder, lambda _: base, said)
        assert coded is not None  # what is written can be read
        return coder.finish(), coded[1]

    def code(
        self, coder: Coder, known: Callable[[int], State | None], said: Said = UNSAID
    ) -> tuple[Said, State] | None:
        """Write what a message says, or read it in place of what is given.

        `known` has what is known of the message so many before it. None for what nobody can have written, or what
        builds on something that is not known.
        """
        terms, size = self.terms, len(self.forest.groups)
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
            end = sum(coder.flat(1 << 16, said.end >> shift & 0xFFFF) << shift for shift in (32, 16, 0))
            end -= end >> 47 << 48  # of either sign
        late = coder.symbol(LATES, min(said.late, 2))
        if late == 2:
            late += coder.flat(terms.delay, said.late - 2)
        finer = coder.symbol(self._fineness, said.finer)
        inner = coder.symbol(KNOT_COUNTS, len(said.cells))
        most_cells = (terms.delay - 1) // terms.grid
        if (inner + 1) * size > max(MOST_GROUPS, size) or inner > most_cells:
            return None
        cells = [1 + coder.flat(most_cells, cell - 1) for cell in said.cells or [1] * inner]
        if len(set(cells)) < inner or max(cells, default=0) * terms.grid >= terms.delay - max(late - 1, 0):
            return None
        groups = said.groups or [[[0, 0, 0] for _ in range(size)] for _ in range(inner + 1)]
        said = Said(back, end, late, finer, cells, groups)
        memory = code(coder, self.forest, groups, said.kind(base), base.memory)
        window = Window(self, base, said, finer)
        for cell, numbers in zip([0, *cells], np.array(groups, dtype=np.float64), strict=True):
            window.say(cell, numbers)
        path = window.path()
        return (said, State(path, memory, end)) if np.abs(path.poses.positions).max() < NOWHERE else None


class Window:
    """The knots of a window: the end, and then others, each between two that are there already."""

    def __init__(self, codec: Codec, base: State, said: Said, finer: int = 0) -> None:
        self._codec, self._said, self.finer, self.factor = codec, said, finer, 0.5**finer
        self._goes_on = said.kind(base) in (NEAR, FAR)
        self.moments = np.array(said.window(codec.terms))
        """Of the start and all knots, rising."""
        # What the motion would do if nothing new came.
        self._poses = base.path.at(self.moments) if self._goes_on else base.path.poses[:, [-1, -1]]
        self.cells: list[int] = []
        """Of each knot, in the order in which they came, how many cells it is before the end."""
        self.supports: list[tuple[float, float, float]] = []
        """Of each the moments between which it has a say, its own in between."""
        self.numbers: list[np.ndarray] = []
        """Of each the whole numbers (groups, 3)."""

    def say(self, cell: int, numbers: np.ndarray | None = None, samples: Path | None = None) -> None:
        """Move the end, which comes first and is cell 0, or else a new knot, by whole numbers (groups, 3).

        Without numbers it is moved as near to what samples have there as these bring it.
        """
        at, moment = 1, (self._said.end - cell * self._codec.terms.grid) / TICKS
        if cell:
            at = int(np.searchsorted(self.moments, moment))
            on_the_way = Path(self.moments, self._poses).pose(moment)[:, None]
            self.moments = np.insert(self.moments, at, moment)
            self._poses = joined((self._poses[:, :at], on_the_way, self._poses[:, at:]), axis=1)
        self.cells.append(cell)
        self.supports.append((self.moments[at - 1], moment, self.moments[min(at + 1, len(self.moments) - 1)]))
        if numbers is None:
            assert samples is not None
            numbers = self._codec.rounded(self._poses[:, at], samples.pose(moment), self.factor)
        self.numbers.append(numbers)
        self._poses[:, at] = self._codec.moved(self._poses[:, at], numbers, self.factor)
        if not (cell or self._goes_on):
            # How the motion got there is not known.
            self._poses[:, 0] = self._poses[:, 1]

    def path(self) -> Path:
        """From the start to the end."""
        poses = Poses(self._poses.positions, normalise(self._poses.quaternions))
        if len(self.moments) == 2 and not self._goes_on:
            return Path(self.moments, poses)
        before, last, span = poses[:, -2], poses[:, -1], self.moments[-1] - self.moments[-2]
        spins = turns_between(before.quaternions, last.quaternions) / span
        return Path(self.moments, poses, (last.positions - before.positions) / span, spins)
