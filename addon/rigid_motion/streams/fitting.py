"""What a message says: as little as keeps every joint's ball within the tolerance, at all moments that are looked at.

First come knots, where they are needed most, and all their numbers as near to the truth as steps are fine. Then numbers
are made smaller one after another, from the ends of the limbs inwards, as long as the whole stays inside: a number that
is 0 costs next to nothing. What a number does to all that hangs on its joint is reckoned to first order, and the
outcome is looked at exactly. Arrays have joints first, (joints, n), and components before them where they are apart.
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
"""Parts of the tolerance that rounding may use; and that smaller numbers may, one after another, while the outcome is
off by more."""

END_TOLERANCE_RATIO, TAPER_START_RATIO = 0.85, 0.4
"""Part of that at the end of a window, from where the motion has to go on well by itself; from this part of it on."""

STILL_TOLERANCE_RATIO, STILL_BEYOND_S, MAX_SAME_MOMENT_S = 0.25, 0.2, 1e-9
"""Part of the tolerance within which a body does not move; so many seconds later it is still where it was; and moments
that are not further apart than so many are the same."""

HELD_SLIP_RATIO = 0.4
"""Part of the tolerance by which what is held may be off in the hand, before it is said anew."""

FAR_APART, MOST_PARTS = 0.013, 8
"""Seconds between samples beyond which it is looked at what is shown between them, and into how many parts at most."""

SMALLER_NUMBER_CHOICES = np.array(
    [[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool
)
"""Which of three numbers are made smaller by 1, the most first."""


class Fitting:
    """Finds what to say of a window of samples, where something is `shown` so far, or nothing.

    The message builds on `base`, which is so many messages `back`, and its window ends at a tick. All has been in the
    same hands since another.
    """

    def __init__(
        self, codec: Codec, shown: KnotPath | None, base: Message, back: int, ticks: int, since: int, samples: KnotPath
    ) -> None:
        self._codec, self._forest, self._shown, self._samples = codec, codec.forest, shown, samples
        self._begun, self._ticks = partial(Message, codec, base, back, ticks, since=since), ticks
        self._room, self._takes = min(codec.terms.delay - 1, ticks - since), since > ticks - codec.terms.delay
        """How many ticks before the end knots may be; and whether something changes hands as the window starts."""
        self._start, self._end = max(ticks - codec.terms.delay, since) / TICKS_PER_S, ticks / TICKS_PER_S
        self._stays = np.zeros(len(codec.forest.groups), dtype=bool)
        """Groups of what stays where it is in a hand."""

    def message(self) -> tuple[Message, bool]:
        """Return the message, and whether all of the window is within the tolerance."""
        (tolerance, _, grid), ticks = self._codec.terms, self._ticks
        moments = self._samples.moments
        inside = moments[(moments > self._start) & (moments < self._end)]
        looked = np.concatenate(([self._start], inside, [self._end]))
        ends = self._samples.at(looked[[0, -1]])
        is_still = self._forest.errors(ends[:, :1], ends[:, 1:]).max() < STILL_TOLERANCE_RATIO * tolerance
        exact = (ticks - looked[not self._takes : -1] * TICKS_PER_S) / grid
        # A jump between two cells takes both of them, everything else the nearest.
        for cells in (np.rint(exact), np.concatenate((np.floor(exact), np.ceil(exact)))):
            cells = np.unique(cells.astype(int))[::-1]
            self._cells = cells[(cells > 0) & (cells * grid <= self._room)]
            self._grid = (ticks - self._cells * grid) / TICKS_PER_S
            between = self._grid[np.abs(self._grid[:, None] - looked).min(axis=1) > MAX_SAME_MOMENT_S]
            self._moments = closely(np.unique(np.concatenate((looked, between))))[not self._takes :]
            if is_still:
                # It is to come to rest, and not to be put right again and again.
                self._moments = np.append(self._moments, self._end + STILL_BEYOND_S)
            truth = self._samples.at(self._moments)
            self._truth, self._stays = self._forest.skeleton.in_root_space(truth), self._staying(truth)
            message, error = self._fitted()
            if error <= tolerance:
                break
        return message, error <= tolerance

    def _staying(self, truth: Poses) -> np.ndarray:
        """Return the groups (groups,) of what stays where it is in a hand, where the truth (joints, n) has it there."""
        held = np.flatnonzero(self._forest.holders >= 0)
        if not len(held):
            return self._stays
        expected = self._begun(0).path.at(self._moments)
        slips = shell_error(expected[held], truth[held], self._forest.reaches[held, None])
        staying = held[
            np.where(self._moments <= self._end, slips, 0.0).max(axis=1) <= HELD_SLIP_RATIO * self._codec.tolerance
        ]
        return np.isin([joint for joint, _, _ in self._forest.groups], staying)

    def _fitted(self) -> tuple[Message, float]:
        """Return the message with knots on the grid, and the largest error at the moments (n,) that are looked at."""
        tolerance, cells = self._codec.tolerance, [0]
        for finer in range(MAX_STEP_HALVINGS + 1):
            message, error = self._near(cells, finer)
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

    def _near(self, cells: list[int], finer: int) -> tuple[Message, float]:
        """Return the numbers nearest to the truth, with knots and, where that is not enough, with more of them."""
        tolerance, most_knots = self._codec.tolerance, min(MAX_KNOTS, max(MOST_GROUPS // len(self._forest.groups), 1))
        message = self._begun(finer)
        for cell in cells:
            message.say(cell, samples=self._samples, stays=self._stays)
        while True:
            errors = self._look(message)[1]
            error, worst = float(errors.max()), self._moments[np.argmax(errors)]
            free = ~np.isin(self._cells, message.cells)
            if error <= ROUNDING_TOLERANCE_RATIO * tolerance or not free.any() or len(message.cells) == most_knots:
                return message, error
            away = np.where(free, np.abs(self._grid - worst), np.inf)
            good = finer < MAX_STEP_HALVINGS or error <= tolerance
            if good and np.abs(message.path.moments[1:] - worst).min() < away.min():
                return message, error
            message.say(int(self._cells[np.argmin(away)]), samples=self._samples, stays=self._stays)

    def _look(self, message: Message) -> tuple[Poses, np.ndarray]:
        """Return what is shown with a message in the root's space (joints, n), and the largest error of each moment."""
        path = message.path if self._shown is None else self._shown.followed(message.path)
        there = self._forest.skeleton.in_root_space(path.at(self._moments))
        errors = shell_error(there, self._truth, self._forest.radii[:, None]).max(axis=0)
        return there, np.where(self._moments <= self._end, errors, 0.0)

    def _smaller(self, message: Message, most: np.ndarray) -> tuple[Message, float]:
        """Return a message with smaller numbers, with which no joint's error is more than `most` (n,)."""
        radii, (there, _) = self._forest.radii[:, None], self._look(message)
        turn = multiply(there.quaternions, conjugate(self._truth.quaternions))
        turn = turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)
        # How far balls are off, and by how much their shells are turned: components first, and free to be written to.
        errors = np.stack(
            list(map(components, (there.positions - self._truth.positions, 2.0 * turn * radii[..., None])))
        )
        places, axes = np.array(components(there.positions), order="C"), matrices(there.quaternions)
        numbers = np.array(message.numbers)
        for own, support in zip(numbers[::-1], message.supports[::-1], strict=True):
            # How much of a knot's numbers is in what is shown: all at its own moment, less and less around that.
            # Beyond the end it goes on as since the knot before.
            before, at_end, *hat = np.interp((*message.path.moments[-2:], *self._moments), support, (0.0, 1.0, 0.0))
            rate = (at_end - before) / (self._end - message.path.moments[-2])
            hat = message.factor * (hat + rate * carried(self._moments - self._end))
            for values, (joint, slide, _) in zip(own[::-1], self._forest.groups[::-1], strict=True):
                if self._forest.holders[joint] >= 0 or not values.any():
                    continue  # What is held is said seldom, and then as it is.
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
        smaller = self._begun(message.finer)
        for cell, own in zip(message.cells, numbers, strict=True):
            smaller.say(cell, own)
        return smaller, float(self._look(smaller)[1].max())


def closely(moments: np.ndarray) -> np.ndarray:
    """Moments (n,) with others between them, where they are far apart."""
    parts = np.clip(np.ceil(np.diff(moments) / FAR_APART).astype(int), 1, MOST_PARTS)
    steps = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts) + 1
    between = np.repeat(moments[:-1], parts) + steps / np.repeat(parts, parts) * np.repeat(np.diff(moments), parts)
    return np.append(moments[:1], between)


def _reduce(values: np.ndarray, errors: np.ndarray, hung: np.ndarray, does: np.ndarray, most: np.ndarray) -> None:
    """Put the smallest numbers that will do in the place of three, and what they do into the errors.

    A step of each number moves places and turns shells: `does`, shape (2, 3 components, 3 numbers, hung, n).
    """
    fewer = np.concatenate((np.zeros((1, 3), dtype=np.int64), values - SMALLER_NUMBER_CHOICES * np.sign(values)))
    before = errors[:, :, hung]
    after = before[:, :, None] + np.einsum("ca,ewahn->ewchn", (fewer - values).astype(np.float64), does)
    # Where it is off by more already, it may not become worse.
    good = (_off(after) <= np.maximum(most, _off(before))).all(axis=(1, 2))
    if good.any():
        first = int(np.argmax(good))
        values[:], errors[:, :, hung] = fewer[first], after[:, :, first]


def _off(errors: np.ndarray) -> np.ndarray:
    """Return by how much balls are off (...) of errors (2, 3, ...)."""
    return largest_displacement(errors[0], errors[1].copy(), np.array(0.5))
