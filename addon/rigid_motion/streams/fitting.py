"""Fitting of messages: the fewest numbers that keep every joint's ball within the tolerance at all checked moments.

First, knots are placed where they are needed most, with all numbers as close to the truth as steps allow. Then numbers
are reduced one after another, from the ends of the limbs inwards, while everything stays within the tolerance: a 0
costs next to nothing. The effect of a number on everything below its joint is estimated to first order, and the outcome
is checked exactly. Arrays have joints first, (joints, n), and before them components where these are separate.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..motion import Poses, shell_error
from ..motion.measures import largest_displacement
from ..motion.quaternions import components, conjugate, cross, matrices, multiply
from .coding import MAX_KNOTS, MAX_STEP_HALVINGS, MOST_GROUPS
from .messages import Codec, Message
from .paths import KnotPath, carried
from .wire import TICKS_PER_S

ROUNDING_TOLERANCE_RATIO, SMALLER_TOLERANCE_RATIOS = 0.97, (0.97, 0.85, 0.7)
"""Fractions of the tolerance: for rounding; and for reducing numbers, tried in turn while the result is off by more."""

END_TOLERANCE_RATIO, TAPER_START_RATIO = 0.85, 0.4
"""Fraction of that at the end of a window, from where the motion should extrapolate well; and the part of the window
before its end over which it is reached."""
STILL_TOLERANCE_RATIO, STILL_BEYOND_S, MAX_SAME_MOMENT_S = 0.25, 0.2, 1e-9
"""Fraction of the tolerance within which a body counts as still; seconds after the end at which it should still be in
place; and largest difference in seconds between equal moments."""

HELD_SLIP_RATIO = 0.4
"""Slip of a held object in the hand that is tolerated before it is sent again, as a fraction of the tolerance."""

FAR_APART, MOST_PARTS = 0.013, 8
"""Longest gap between samples in seconds that is not checked in between; and the most parts to check in a gap."""

SMALLER_NUMBER_CHOICES = np.array(
    [[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool
)
"""Which of three numbers are reduced by 1, the most first."""


class Fitting:
    """Finds the message for a window of samples, given the path `shown` so far, if any.

    The message builds on `base`, which is `back` messages before it, and its window ends at `ticks`. Holders have not
    changed since the tick `since`.
    """

    def __init__(
        self, codec: Codec, shown: KnotPath | None, base: Message, back: int, ticks: int, since: int, samples: KnotPath
    ) -> None:
        self._codec, self._forest, self._shown, self._samples = codec, codec.forest, shown, samples
        self._new_message, self._ticks = partial(Message, codec, base, back, ticks, since=since), ticks
        self._room, self._changes_holders = min(codec.terms.delay - 1, ticks - since), since > ticks - codec.terms.delay
        """Most ticks before the end at which knots may be; and whether holders change as the window starts."""
        self._start, self._end = max(ticks - codec.terms.delay, since) / TICKS_PER_S, ticks / TICKS_PER_S
        self._stays = np.zeros(len(codec.forest.groups), dtype=bool)
        """Groups of held objects that keep their place in the hand."""

    def message(self) -> tuple[Message, bool]:
        """Return the message, and whether the whole window is within the tolerance."""
        (tolerance, _, grid), ticks = self._codec.terms, self._ticks
        moments = self._samples.moments
        inside = moments[(moments > self._start) & (moments < self._end)]
        looked = np.concatenate(([self._start], inside, [self._end]))
        ends = self._samples.at(looked[[0, -1]])
        is_still = self._forest.errors(ends[:, :1], ends[:, 1:]).max() < STILL_TOLERANCE_RATIO * tolerance
        exact = (ticks - looked[not self._changes_holders : -1] * TICKS_PER_S) / grid
        # A jump between two cells takes both of them, anything else the nearest.
        for cells in (np.rint(exact), np.concatenate((np.floor(exact), np.ceil(exact)))):
            cells = np.unique(cells.astype(int))[::-1]
            self._cells = cells[(cells > 0) & (cells * grid <= self._room)]
            self._grid = (ticks - self._cells * grid) / TICKS_PER_S
            between = self._grid[np.abs(self._grid[:, None] - looked).min(axis=1) > MAX_SAME_MOMENT_S]
            self._moments = closely(np.unique(np.concatenate((looked, between))))[not self._changes_holders :]
            if is_still:
                # The body should come to rest, without repeated corrections.
                self._moments = np.append(self._moments, self._end + STILL_BEYOND_S)
            truth = self._samples.at(self._moments)
            self._truth, self._stays = self._forest.skeleton.in_root_space(truth), self._staying(truth)
            message, error = self._fitted()
            if error <= tolerance:
                break
        return message, error <= tolerance

    def _staying(self, truth: Poses) -> np.ndarray:
        """Return which groups (groups,) belong to held objects that keep their place, given the truth (joints, n)."""
        held = np.flatnonzero(self._forest.holders >= 0)
        if not len(held):
            return self._stays
        expected = self._new_message(0).path.at(self._moments)
        slips = shell_error(expected[held], truth[held], self._forest.reaches[held, None])
        staying = held[
            np.where(self._moments <= self._end, slips, 0.0).max(axis=1) <= HELD_SLIP_RATIO * self._codec.tolerance
        ]
        return np.isin([joint for joint, _, _ in self._forest.groups], staying)

    def _fitted(self) -> tuple[Message, float]:
        """Return the message with knots on the grid, and its largest error at the checked moments (n,)."""
        tolerance, cells = self._codec.tolerance, [0]
        for finer in range(MAX_STEP_HALVINGS + 1):
            message, error = self._nearest(cells, finer)
            if error <= ROUNDING_TOLERANCE_RATIO * tolerance:
                break
            cells = message.cells
        left = np.maximum(self._end - self._moments, 0.0) / (self._end - self._start)
        most = tolerance * np.minimum(END_TOLERANCE_RATIO + (1.0 - END_TOLERANCE_RATIO) * left / TAPER_START_RATIO, 1.0)
        for margin in SMALLER_TOLERANCE_RATIOS:
            smaller = self._smaller(message, margin * most)
            if smaller[1] <= max(tolerance, error):
                return smaller
        return message, error

    def _nearest(self, cells: list[int], finer: int) -> tuple[Message, float]:
        """Return the numbers closest to the truth, with the given knots and more if needed."""
        tolerance, most_knots = self._codec.tolerance, min(MAX_KNOTS, max(MOST_GROUPS // len(self._forest.groups), 1))
        message = self._new_message(finer)
        for cell in cells:
            message.say(cell, samples=self._samples, stays=self._stays)
        while True:
            errors = self._shown_errors(message)[1]
            error, worst = float(errors.max()), self._moments[np.argmax(errors)]
            free = ~np.isin(self._cells, message.cells)
            if error <= ROUNDING_TOLERANCE_RATIO * tolerance or not free.any() or len(message.cells) == most_knots:
                return message, error
            away = np.where(free, np.abs(self._grid - worst), np.inf)
            good = finer < MAX_STEP_HALVINGS or error <= tolerance
            if good and np.abs(message.path.moments[1:] - worst).min() < away.min():
                return message, error
            message.say(int(self._cells[np.argmin(away)]), samples=self._samples, stays=self._stays)

    def _shown_errors(self, message: Message) -> tuple[Poses, np.ndarray]:
        """Return the shown poses (joints, n) in the root's space with a message, and the largest error per moment."""
        path = message.path if self._shown is None else self._shown.followed(message.path)
        there = self._forest.skeleton.in_root_space(path.at(self._moments))
        errors = shell_error(there, self._truth, self._forest.radii[:, None]).max(axis=0)
        return there, np.where(self._moments <= self._end, errors, 0.0)

    def _smaller(self, message: Message, most: np.ndarray) -> tuple[Message, float]:
        """Return a message with smaller numbers that keeps every joint's error within `most` (n,)."""
        radii, (there, _) = self._forest.radii[:, None], self._shown_errors(message)
        turn = multiply(there.quaternions, conjugate(self._truth.quaternions))
        turn = turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)
        # Displacements of balls and rotations of their shells: components first, and writable.
        errors = np.stack(
            list(map(components, (there.positions - self._truth.positions, 2.0 * turn * radii[..., None])))
        )
        places, axes = np.array(components(there.positions), order="C"), matrices(there.quaternions)
        numbers = np.array(message.numbers)
        for own, support in zip(numbers[::-1], message.supports[::-1], strict=True):
            # Weight of a knot's numbers in the shown motion: all at its own moment, less and less around it.
            # Beyond the end the motion is extrapolated from the last two knots.
            before, at_end, *hat = np.interp((*message.path.moments[-2:], *self._moments), support, (0.0, 1.0, 0.0))
            rate = (at_end - before) / (self._end - message.path.moments[-2])
            hat = message.factor * (hat + rate * carried(self._moments - self._end))
            for values, (joint, slide, _) in zip(own[::-1], self._forest.groups[::-1], strict=True):
                if self._forest.holders[joint] >= 0 or not values.any():
                    continue  # Held objects are sent seldom, and then exactly.
                hung, parent = self._forest.skeleton.below(joint), self._forest.parents[joint]
                if slide:
                    along = np.eye(3)[..., None] if parent < 0 else axes[:, :, parent]
                    does = np.zeros((2, 3, 3, 1, len(hat)))
                    does[0] = (along * (self._codec.slide_steps[joint] * hat))[:, :, None]
                else:
                    about = (axes[:, :, joint] * (self._codec.turn_steps[joint] * hat))[:, :, None]
                    arms = (places[:, hung] - places[:, [joint]])[:, None]
                    does = np.stack([cross(about, arms), about * radii[hung]])
                _reduce(values, errors, hung, does, most)
        smaller = self._new_message(message.finer)
        for cell, own in zip(message.cells, numbers, strict=True):
            smaller.say(cell, own)
        return smaller, float(self._shown_errors(smaller)[1].max())


def closely(moments: np.ndarray) -> np.ndarray:
    """Return moments (n,), with more moments in gaps that are long."""
    parts = np.clip(np.ceil(np.diff(moments) / FAR_APART).astype(int), 1, MOST_PARTS)
    steps = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts) + 1
    between = np.repeat(moments[:-1], parts) + steps / np.repeat(parts, parts) * np.repeat(np.diff(moments), parts)
    return np.append(moments[:1], between)


def _reduce(values: np.ndarray, errors: np.ndarray, hung: np.ndarray, does: np.ndarray, most: np.ndarray) -> None:
    """Replace three numbers by the smallest that stay within the limit, and update the errors.

    A step of each number moves positions and turns shells: `does`, shape (2, 3 components, 3 numbers, hung, n).
    """
    fewer = np.concatenate((np.zeros((1, 3), dtype=np.int64), values - SMALLER_NUMBER_CHOICES * np.sign(values)))
    before = errors[:, :, hung]
    after = before[:, :, None] + np.einsum("ca,ewahn->ewchn", (fewer - values).astype(np.float64), does)
    # Errors that are already larger may not grow.
    good = (_displacements(after) <= np.maximum(most, _displacements(before))).all(axis=(1, 2))
    if good.any():
        first = int(np.argmax(good))
        values[:], errors[:, :, hung] = fewer[first], after[:, :, first]


def _displacements(errors: np.ndarray) -> np.ndarray:
    """Return the displacements of balls (...) for errors (2, 3, ...)."""
    return largest_displacement(errors[0], errors[1].copy(), np.array(0.5))
