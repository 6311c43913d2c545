"""Messages: what their whole numbers are in metres and radians, what the next one builds on, and their payloads.

A message says the poses of all joints at the end of a window, and at moments within it where that is not enough. The
end is coded against what the motion did so far, each other knot against the straight way between those around it that
were said before. Residuals of a turn are a rotation vector in the joint's own axes, those of a slide are in its
parent's space; both are counted in steps.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from ..motion import Poses
from ..motion.quaternions import normalise
from .bodies import Forest
from .coding import Decoder, Encoder
from .paths import Path, at_rest, turned, turns_between
from .residuals import FAR, FINENESS, KNOT_COUNTS, MOST_GROUPS, NEAR, STALE, UNKNOWN, Groups, Walk
from .wire import TICKS, Terms

OLD = TICKS // 2
"""Ticks after which a pose says nothing any more about how the motion goes on."""

TURN_STEP, SLIDE_STEP = 1.0, 0.5
"""Steps, in tolerances: at the end of what hangs on a joint, and of its place."""

FURTHEST = 1e5
"""Metres from the middle of everything at which nothing is any more."""


@dataclass(frozen=True, eq=False)
class State:
    """What both sides know of a message: its window, which the next one builds on."""

    path: Path
    """From the start of the window to its end."""

    memory: tuple[int, ...]
    """Of each group, how large its residuals were."""

    end: int
    """The ticks of the end of the window."""

    def kind(self, end: int, back: int) -> int:
        """How the end of a window, at some ticks, is coded against this, so many messages back."""
        if not back:
            return UNKNOWN
        return STALE if not 0 <= end - self.end <= OLD else NEAR if back == 1 else FAR


@dataclass(frozen=True)
class Said:
    """What a message says, in whole numbers."""

    finer: int
    """How many times its steps are halved."""

    cells: list[int]
    """Of each knot besides the end, how many cells of the grid it is before the end, in the order of their numbers."""

    groups: Groups
    """Of each knot, the end first, and each group three numbers."""

    late: int = 0
    """Ticks by which it is sent later than at its end: by so many its window is shorter. Below the delay."""


class Codec:
    """Messages of a forest: their steps and the order of their groups, to bytes and back."""

    def __init__(self, forest: Forest, terms: Terms) -> None:
        self.forest, self.terms, self.walk = forest, terms, Walk(forest)
        self.tolerance = terms.tolerance / 1e6
        slides = np.array(self.walk.slides, dtype=bool)
        self._turns, self._slides = np.flatnonzero(~slides), np.flatnonzero(slides)
        """The groups of each kind: all joints turn."""
        self.turn_steps = TURN_STEP * self.tolerance / forest.reaches
        self.slide_step = SLIDE_STEP * self.tolerance
        self._fineness = FINENESS + bool((forest.parents >= 0).any())
        self.rest = State(Path(np.zeros(1), forest.rest[:, None]), (0,) * len(self.walk), 0)
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
        numbers = np.zeros((len(self.walk), 3), dtype=np.int64)
        numbers[self._slides], numbers[self._turns] = np.rint(slides[self.forest.sliding]), np.rint(turns)
        return numbers

    def write(self, said: Said, kind: int, state: State, is_late: bool) -> tuple[bytes, tuple[int, ...]]:
        """Return the payload, and what the next message remembers."""
        coder = Encoder()
        through = self.through(coder, said, kind, state, is_late)
        assert through is not None  # what is written can be read
        return coder.finish(), through[1]

    def read(self, payload: bytes, kind: int, state: State, is_late: bool) -> tuple[Said, tuple[int, ...]] | None:
        """Return what a payload says, and what the next message remembers; None for what nobody can have written."""
        return self.through(Decoder(payload), Said(0, [], []), kind, state, is_late)

    def through(
        self, coder: Encoder | Decoder, said: Said, kind: int, state: State, is_late: bool
    ) -> tuple[Said, tuple[int, ...]] | None:
        """Write what a message says, or read it in place of what is given."""
        late = coder.flat(self.terms.delay, said.late) if is_late else 0
        finer = coder.symbol(self._fineness, said.finer)
        inner = coder.symbol(KNOT_COUNTS, len(said.cells))
        size = len(self.walk)
        if (inner + 1) * size > max(MOST_GROUPS, size) or inner > self.terms.cells:
            return None
        cells = [1 + coder.flat(self.terms.cells, cell - 1) for cell in said.cells or [1] * inner]
        if len(set(cells)) < inner or max(cells, default=0) * self.terms.grid >= self.terms.delay - late:
            return None
        groups = said.groups or [[[0, 0, 0] for _ in range(size)] for _ in range(inner + 1)]
        memory = self.walk.through(coder, groups, kind, state.memory)
        return Said(finer, cells, groups, late), tuple(memory)

    def path(self, said: Said, state: State, kind: int, end: int) -> Path | None:
        """Return the path of a message that ends at some ticks; None where that is nowhere."""
        start = (end + said.late - self.terms.delay) / TICKS
        window = Window(self, state, kind, start, end / TICKS, said.finer)
        cells = [(end - cell * self.terms.grid) / TICKS for cell in said.cells]
        for moment, numbers in zip([None, *cells], np.array(said.groups, dtype=np.float64), strict=True):
            window.say(numbers, moment)
        path = window.path()
        return path if np.abs(path.poses.positions).max() < FURTHEST else None


class Window:
    """The knots of a window: the end, and then others, each between two that are there already."""

    def __init__(self, codec: Codec, state: State, kind: int, start: float, end: float, finer: int = 0) -> None:
        self._codec, self.finer, self.factor, self._goes_on = codec, finer, 0.5**finer, kind in (NEAR, FAR)
        # What the motion would do if nothing new came.
        expected = state.path.at(np.array([start, end])) if self._goes_on else state.path.poses[:, [-1, -1]]
        self.moments = [start, end]
        """Of the start and all knots, rising."""
        self._poses = [expected[:, 0], expected[:, 1]]
        self.supports = [(start, end, end)]
        """Of each knot, in the order in which they came, the moments between which it has a say, its own in between."""
        self.numbers: list[np.ndarray] = []
        """Of each of them the whole numbers (groups, 3)."""

    @property
    def inner(self) -> list[float]:
        """The moments of the knots besides the end, in the order in which they came."""
        return [moment for _, moment, _ in self.supports[1:]]

    def say(self, numbers: np.ndarray, moment: float | None = None) -> None:
        """Move the end, which comes first, or else a new knot at a moment, by whole numbers (groups, 3)."""
        self._move(self._place(moment), numbers)

    def fit(self, samples: Path, moment: float | None = None) -> None:
        """Move a knot as near to what samples have there as whole numbers bring it."""
        at = self._place(moment)
        desired = samples.pose(self.moments[at])
        self._move(at, self._codec.rounded(self._poses[at], desired, self.factor))

    def _move(self, at: int, numbers: np.ndarray) -> None:
        self.numbers.append(numbers)
        self._poses[at] = self._codec.moved(self._poses[at], numbers, self.factor)
        if len(self.moments) == 2 and not self._goes_on:
            # How the motion got there is not known.
            self._poses[0] = self._poses[1]

    def _place(self, moment: float | None) -> int:
        """Return the place of the end or of a new knot, on the straight way between its neighbours."""
        if moment is None:
            return 1
        at = bisect_left(self.moments, moment)
        before, after = self.moments[at - 1], self.moments[at]
        share, first, second = (moment - before) / (after - before), self._poses[at - 1], self._poses[at]
        turn = share * turns_between(first.quaternions, second.quaternions)
        place = first.positions + share * (second.positions - first.positions)
        self.supports.append((before, moment, after))
        self.moments.insert(at, moment)
        self._poses.insert(at, Poses(place, turned(first.quaternions, turn)))
        return at

    def path(self) -> Path:
        """From the start to the end."""
        moments = np.array(self.moments)
        positions = np.stack([own.positions for own in self._poses], axis=1)
        quaternions = normalise(np.stack([own.quaternions for own in self._poses], axis=1))
        velocities = spins = at_rest()
        if len(moments) > 2 or self._goes_on:
            span = moments[-1] - moments[-2]
            velocities = (positions[:, -1] - positions[:, -2]) / span
            spins = turns_between(quaternions[:, -2], quaternions[:, -1]) / span
        return Path(moments, Poses(positions, quaternions), velocities, spins)
