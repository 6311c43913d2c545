"""Messages of a stream: converting poses to integers and bytes, coded against an earlier message, and back.

A message has the poses of all joints at the end of a window, and at moments within it if needed. The end is coded
against the motion so far, each inner knot against the straight path between the knots around it that came before.
Residuals of a turn are a rotation vector in the joint's own axes, residuals of a slide are in its parent's space; both
in steps.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import normalise, turned, turns_between
from .bodies import LEVER_LEVELS, Forest, Hold
from .coding import (
    BASES_TABLE,
    FAR_KNOT,
    FINENESS_TABLE,
    HANDS_TABLE,
    KNOT_COUNTS,
    MOST_GROUPS,
    NEAR_KNOT,
    ODD_TABLE,
    STALE_KNOT,
    UNKNOWN_KNOT,
    Coder,
    code,
)
from .paths import KnotPath
from .wire import TICKS_PER_S, Terms

OLD_POSE_TICKS = TICKS_PER_S // 2
"""Ticks after which a pose no longer tells how the motion goes on."""

MAX_MESSAGES_BACK, MAX_TICKS_BACK = 129, 3 * TICKS_PER_S
"""Most messages, and most ticks between the ends, from a message to the one it builds on."""

TURN_STEP, SLIDE_STEP = 1.0, 0.5
"""Steps as fractions of the tolerance: at the farthest point below a turning joint, and of a joint's position."""

HELD_STEP = 0.125
"""Steps of held objects, as a fraction of the steps when not held: the pose is sent once and then moves along."""

NEVER_TICK = -(1 << 62)
"""Tick of the last change of holders, if there was none."""

MAX_DISTANCE_M = 1e5
"""Distance from the origin in metres beyond which poses are invalid."""


class Codec:
    """Coder for messages of a forest: their steps, and conversion to bytes and back.

    The codec of the forest as described, without holds, reads and writes all messages.
    """

    def __init__(self, forest: Forest, terms: Terms) -> None:
        self.forest, self.terms = forest, terms
        self.tolerance = terms.tolerance
        slides = np.array([slide for _, slide, _ in forest.groups], dtype=bool)
        self._turns, self._slides = np.flatnonzero(~slides), np.flatnonzero(slides)
        """Groups of each kind: all joints turn, some slide."""
        parts = np.where(forest.holders >= 0, HELD_STEP, 1.0)
        self.turn_steps = TURN_STEP * self.tolerance / forest.reaches * parts
        self.slide_steps = SLIDE_STEP * self.tolerance * parts
        self._fineness = FINENESS_TABLE + bool((forest.parents >= 0).any())
        self.rest = Message(self)
        """The state before any message."""

    def holding(self, holds: tuple[Hold, ...]) -> Codec:
        """Return the codec of the same forest with these holds. Raises ValueError if they are impossible."""
        return Codec(self.forest.holding(holds), self.terms) if holds else self

    def moved(self, poses: Poses, numbers: np.ndarray, factor: float) -> Poses:
        """Return poses (joints,) moved by integers (groups, 3), in steps times a factor."""
        places, turns = poses.positions.copy(), numbers[self._turns] * (self.turn_steps * factor)[:, None]
        sliding = self.forest.sliding
        places[sliding] += numbers[self._slides] * (self.slide_steps[sliding] * factor)[:, None]
        return Poses(places, turned(poses.quaternions, turns))

    def rounded(self, poses: Poses, desired: Poses, factor: float) -> np.ndarray:
        """Return the integers (groups, 3) that move poses (joints,) closest to the desired ones."""
        slides = (desired.positions - poses.positions) / (self.slide_steps * factor)[:, None]
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
        """Write a message, or read one if none is given.

        `known` returns the message a given number of messages back. Returns None for invalid data, or if the message
        builds on an unknown one.
        """
        terms, size, said = self.terms, len(self.forest.groups), message or self.rest
        back = coder.symbol(BASES_TABLE, min(said.back, 2))
        if back == 2:
            back += coder.flat(MAX_MESSAGES_BACK - 1, said.back - 2)
        base = known(back) if back else self.rest
        if base is None:
            return None
        if back:
            whole, odd = divmod(said.end - base.end, terms.grid)
            end = base.end + terms.grid * coder.flat(MAX_TICKS_BACK // terms.grid + 1, whole)
            end += coder.flat(terms.grid, odd) if coder.symbol(ODD_TABLE, int(odd > 0)) else 0
        else:
            end = coder.digits(48, said.end)
            end -= end >> 47 << 48  # Sign extension.
        hands = self._code_holds(coder, base, end, message)
        if hands is None:
            return None
        codec, since = hands
        finer = coder.symbol(self._fineness, said.finer)
        inner = coder.symbol(KNOT_COUNTS, len(said.cells) - 1)
        most_cells = (terms.delay - 1) // terms.grid
        if (inner + 1) * size > max(MOST_GROUPS, size) or inner > most_cells:
            return None
        cells = [1 + coder.flat(most_cells, cell - 1) for cell in said.cells[1:] or [1] * inner]
        if len(set(cells)) < inner:
            return None
        groups = [own.tolist() for own in said.numbers] or [[[0, 0, 0] for _ in range(size)] for _ in range(inner + 1)]
        read = message or Message(codec, base, back, end, finer, since)
        if any(cell * terms.grid > end - read.start for cell in cells):
            return None
        read.memory = code(coder, self.forest, groups, read.kind, base.memory)
        if holders := read.codec.forest.holds and read.codec.forest.holders.tolist():
            # Held objects are sent once, and then keep their place.
            joints = (joint for joint, *_ in self.forest.groups)
            read.memory = tuple(
                0 if holders[joint] >= 0 else old for joint, old in zip(joints, read.memory, strict=True)
            )
        if message is None:
            for cell, numbers in zip([0, *cells], groups, strict=True):
                read.say(cell, np.array(numbers))
        return read if read.is_somewhere else None

    def _code_holds(self, coder: Coder, base: Message, end: int, message: Message | None) -> tuple[Codec, int] | None:
        """Write or read the holds, and the tick since which they are valid; None for invalid data.

        They are either the same as at the base's end, or written in full.
        """
        delay, forest = self.terms.delay, self.forest
        since, holds = (message.since, message.codec.forest.holds) if message else (NEVER_TICK, ())
        changes = holds != base.codec.forest.holds or since > max(base.since, end - delay)
        if not coder.symbol(HANDS_TABLE, int(changes)):
            return base.codec, base.since
        since = end - 1 - coder.flat(delay, min(end - since, delay) - 1)
        count = coder.flat(len(forest.bodies) + 1, len(holds))
        said = tuple(
            Hold(coder.flat(len(forest.bodies), body), coder.flat(len(forest), joint), coder.flat(LEVER_LEVELS, level))
            for body, joint, level in holds or [Hold(0, 0)] * count
        )
        if any(hold.body <= before.body for before, hold in pairwise(said)):
            return None
        try:
            read = base.codec if said == base.codec.forest.holds else self.holding(said)
        except ValueError:
            return None
        return (message.codec if message else read), since


class Message:
    """The content of a message for a window: poses at its knots, the end first, then inner knots.

    It builds on `base`, which is `back` messages before it, 0 for the state before any message. Its window ends at the
    tick `end`, and steps are halved `finer` times. The holds of its codec's forest are valid since the tick `since`,
    and the window does not start earlier. Other messages can build on it.
    """

    def __init__(
        self,
        codec: Codec,
        base: Message | None = None,
        back: int = 0,
        end: int = 0,
        finer: int = 0,
        since: int = NEVER_TICK,
    ) -> None:
        self.codec, self.back, self.end, self.finer, self.since = codec, back, end, finer, since
        self.start = max(end - codec.terms.delay, since)
        """The tick at which the window starts."""
        self.factor = 0.5**finer
        """Factor on the steps."""
        self.kind, self._goes_on = UNKNOWN_KNOT, False
        """How the end is coded, a kind of knot in `coding`; and whether it is coded against the extrapolated motion."""
        self.cells: list[int] = []
        """For each knot, in order of coding, the number of grid cells before the end."""
        self.supports: list[tuple[float, float, float]] = []
        """For each knot the moments between which it has an effect, with its own moment in the middle."""
        self.numbers: list[np.ndarray] = []
        """For each knot the integers (groups, 3)."""
        self.memory: tuple[int, ...] = (0,) * len(codec.forest.groups)
        """Smoothed magnitudes of the residuals of each group."""
        self.path = KnotPath(np.zeros(1), codec.forest.rest[:, None])
        self._changed_hands: np.ndarray | None = None
        """Whether each joint has another holder than in the base (joints,), if any has."""
        """The path of the window, extrapolated until poses are set by `say`."""
        if base:
            moments = np.array((self.start, end)) / TICKS_PER_S
            if back:
                self.kind = STALE_KNOT if end - base.end > OLD_POSE_TICKS else NEAR_KNOT if back == 1 else FAR_KNOT
                self._goes_on = self.kind in (NEAR_KNOT, FAR_KNOT)
            poses = base.path.at(moments) if self._goes_on else base.path.poses[:, [-1, -1]]
            forest, taken = codec.forest, codec.forest.holders != base.codec.forest.holders
            if taken.any():
                self._changed_hands = taken
                poses[taken] = forest.rest[:, None][taken][:, [0, 0]]
            self.path = KnotPath(moments, poses, holders=forest.holders[:, None])

    @property
    def is_somewhere(self) -> bool:
        """Whether all joints are at valid positions; otherwise no receiver reads the message."""
        return bool(np.abs(self.path.poses.positions).max() < MAX_DISTANCE_M)

    def say(
        self,
        cell: int,
        numbers: np.ndarray | None = None,
        samples: KnotPath | None = None,
        stays: np.ndarray | slice = slice(0),
    ) -> None:
        """Set the end, which comes first and is cell 0, or a new knot, by adding integers (groups, 3).

        Without integers, the pose is moved as close as possible to the samples, except for groups that stay.
        """
        at, moment = 1, (self.end - cell * self.codec.terms.grid) / TICKS_PER_S
        moments, poses = self.path.moments, self.path.poses
        if cell:
            at = int(np.searchsorted(moments, moment, side="right"))
            moments = np.insert(moments, at, moment)
            poses = joined((poses[:, :at], self.path.pose(moment)[:, None], poses[:, at:]), axis=1)
        self.cells.append(cell)
        self.supports.append((moments[at - 1], moment, moments[at + 1] if cell else np.inf))
        if numbers is None:
            assert samples is not None
            numbers = self.codec.rounded(poses[:, at], samples.pose(moment), self.factor)
            numbers[stays] = 0
        self.numbers.append(numbers)
        poses[:, at] = self.codec.moved(poses[:, at], numbers, self.factor)
        if not (cell or self._goes_on):
            # The motion before the end is unknown.
            poses[:, 0] = poses[:, 1]
        if self._changed_hands is not None:
            # The motion into these hands is unknown.
            poses[self._changed_hands, 0] = poses[self._changed_hands, 1]
        poses = Poses(poses.positions, normalise(poses.quaternions))
        self.path = KnotPath(moments, poses, holders=self.path.holders[:, :1]).going_on()
        # Held objects move along with the hand, without velocities of their own.
        held = self.codec.forest.holders >= 0
        self.path.velocities[held] = self.path.spins[held] = 0.0
