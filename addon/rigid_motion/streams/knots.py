"""Knots: what the whole numbers of a message are in metres and radians, and what the next message builds on.

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
from .paths import Path, speeds, transposed, turned, turns_between
from .residuals import FAR, NEAR, STALE, UNKNOWN, Walk
from .wire import TICKS

FINEST = 3
"""Steps are halved so many times at most."""

OLD = TICKS // 2
"""Ticks after which a pose says nothing any more about how the motion goes on."""

TURN_STEP, SLIDE_STEP = 1.0, 0.5
"""Steps, in tolerances: at the end of what hangs on a joint, and of its place."""


class Scale:
    """The steps of a forest, and the order of its groups."""

    def __init__(self, forest: Forest, tolerance: float) -> None:
        self.forest, self.tolerance = forest, tolerance
        self.walk = Walk(forest)
        joints, slides = np.array(self.walk.joints), np.array(self.walk.slides, dtype=bool)
        self.turning, self.sliding = joints[~slides], joints[slides]
        self.turns, self.slides = np.flatnonzero(~slides), np.flatnonzero(slides)
        """The groups of each kind."""
        self.turn_steps = TURN_STEP * tolerance / forest.reaches[self.turning]
        self.slide_step = SLIDE_STEP * tolerance

    def residuals(self, numbers: np.ndarray, factor: float) -> tuple[np.ndarray, np.ndarray]:
        """Slides and rotation vectors (joints, 3) of whole numbers (groups, 3), in steps times a factor."""
        slides, turns = np.zeros((2, len(self.forest), 3))
        slides[self.sliding] = numbers[self.slides] * (self.slide_step * factor)
        turns[self.turning] = numbers[self.turns] * (self.turn_steps * factor)[:, None]
        return slides, turns

    def rounded(self, slides: np.ndarray, turns: np.ndarray, factor: float) -> np.ndarray:
        """Return the whole numbers (groups, 3) nearest to slides and rotation vectors (joints, 3)."""
        numbers = np.zeros((len(self.walk), 3), dtype=np.int64)
        numbers[self.slides] = np.rint(slides[self.sliding] / (self.slide_step * factor))
        numbers[self.turns] = np.rint(turns[self.turning] / (self.turn_steps * factor)[:, None])
        return numbers


@dataclass(frozen=True, eq=False)
class State:
    """What both sides know of a message: its window, which the next one builds on."""

    path: Path
    """From the start of the window to its end."""

    memory: tuple[int, ...]
    """Of each group, how large its residuals were."""

    end: int
    """The ticks of the end of the window."""

    @classmethod
    def at_rest(cls, scale: Scale) -> State:
        """Before any message."""
        rest, still = scale.forest.rest, np.zeros((len(scale.forest), 3))
        path = Path(np.zeros(1), rest.positions[None], rest.quaternions[None], still, still)
        return cls(path, (0,) * len(scale.walk), 0)

    def kind(self, end: int, back: int) -> int:
        """How the end of a window, at some ticks, is coded against this, so many messages back."""
        if not back:
            return UNKNOWN
        if not 0 <= end - self.end <= OLD:
            return STALE
        return NEAR if back == 1 else FAR

    def at(self, moments: np.ndarray, kind: int) -> Poses:
        """Return what the motion would do at moments (n,) if nothing new came, shape (n, joints)."""
        if kind in (NEAR, FAR):
            return transposed(self.path.at(moments))
        rows = np.full(len(moments), -1)
        return Poses(self.path.positions[rows], self.path.quaternions[rows])


class Window:
    """The knots of a window: the end, and then others, each between two that are there already."""

    def __init__(self, scale: Scale, state: State, kind: int, start: float, end: float, finer: int = 0) -> None:
        self.scale, self.kind, self.factor = scale, kind, 0.5**finer
        expected = state.at(np.array([start, end]), self.kind)
        self.moments = [start, end]
        """Of the start and all knots, rising."""
        self.positions = list(expected.positions)
        self.quaternions = list(expected.quaternions)
        self.supports: list[tuple[float, float, float]] = [(start, end, end)]
        """Of each knot, in the order in which they came, the moments between which it has a say, its own in between."""

    def put(self, slides: np.ndarray, turns: np.ndarray, at: int = 1) -> None:
        """Move a knot by slides and rotation vectors (joints, 3): the end, which is the first that is put."""
        self.positions[at] = self.positions[at] + slides
        self.quaternions[at] = turned(self.quaternions[at], turns)
        if at == len(self.moments) - 1 == 1 and self.kind not in (NEAR, FAR):
            # How the motion got there is not known.
            self.positions[0], self.quaternions[0] = self.positions[1], self.quaternions[1]

    def insert(self, moment: float) -> int:
        """Add a knot on the straight way between its neighbours, and return its place."""
        at = bisect_left(self.moments, moment)
        before, after = self.moments[at - 1], self.moments[at]
        self.supports.append((before, moment, after))
        share = (moment - before) / (after - before)
        first = self.quaternions[at - 1]
        turn = turned(first, share * turns_between(first, self.quaternions[at]))
        place = self.positions[at - 1] + share * (self.positions[at] - self.positions[at - 1])
        self.moments.insert(at, moment)
        self.positions.insert(at, place)
        self.quaternions.insert(at, turn)
        return at

    def say(self, numbers: np.ndarray, at: int = 1) -> None:
        """Move a knot by whole numbers (groups, 3)."""
        self.put(*self.scale.residuals(numbers, self.factor), at)

    def fit(self, desired: Poses, at: int = 1) -> np.ndarray:
        """Move a knot as near to poses (joints,) as whole numbers (groups, 3) bring it, and return those."""
        turns = turns_between(self.quaternions[at], desired.quaternions)
        numbers = self.scale.rounded(desired.positions - self.positions[at], turns, self.factor)
        self.say(numbers, at)
        return numbers

    def path(self) -> Path:
        """From the start to the end."""
        moments = np.array(self.moments)
        positions, quaternions = np.array(self.positions), normalise(np.array(self.quaternions))
        velocities = spins = np.zeros_like(positions[-1])
        if len(moments) > 2 or self.kind in (NEAR, FAR):
            velocities, spins = speeds(moments[-1] - moments[-2], positions[-2:], quaternions[-2:])
        return Path(moments, positions, quaternions, velocities, spins)
