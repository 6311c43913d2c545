"""What a message says: as little as keeps every joint's ball within the tolerance, at all moments that are looked at.

First come knots, where they are needed most, and all their numbers as near to the truth as steps are fine. Then numbers
are made smaller one after another, from the ends of the limbs inwards, as long as the whole stays inside: a number that
is 0 costs next to nothing. What a number does to all that hangs on its joint is reckoned to first order, and the
outcome is looked at exactly. Arrays have joints first, (joints, n), and components before them where they are apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..motion import shell_error
from ..motion.measures import largest_displacement
from ..motion.quaternions import components, conjugate, cross, matrices, multiply
from .messages import Codec, Said, State, Window
from .paths import Path, carried
from .residuals import FINEST, MOST_GROUPS, MOST_KNOTS
from .wire import TICKS

NEAR, MARGINS = 0.97, (0.97, 0.85, 0.7)
"""Parts of the tolerance that rounding may use; and that smaller numbers may, one after another, while the outcome is
off by more."""

AT_END, TAPER = 0.85, 0.4
"""Part of that at the end of a window, from where the motion has to go on well by itself; from this part of it on."""

STILL, BEYOND, NOTHING = 0.25, 0.2, 1e-9
"""Part of the tolerance within which a body does not move; so many seconds later it is still where it was; and moments
that are not further apart than so many are the same."""

FAR_APART, MOST_PARTS = 0.013, 8
"""Seconds between samples beyond which it is looked at what is shown between them, and into how many parts at most."""

CHOICES = np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
"""Which of three numbers are made smaller."""


class Fitted(NamedTuple):
    """A message that could be sent, what is shown with it, and the largest error within the window."""

    window: Window
    path: Path
    error: float


class Fitting:
    """Finds what to say of a window of samples, where something is `shown` so far, or nothing.

    The message builds on `base`; `head` says how it does, and its window.
    """

    def __init__(self, codec: Codec, shown: Path | None, base: State, head: Said, samples: Path) -> None:
        self._codec, self._forest, self._shown, self._samples = codec, codec.forest, shown, samples
        self._base, self._head = base, head
        self._start, self._end = head.window(codec.terms)

    def said(self) -> tuple[Said, bool]:
        """Return the message, and whether all of the window is within the tolerance."""
        tolerance, (_, delay, grid), ticks = self._codec.tolerance, self._codec.terms, self._head.end
        moments = self._samples.moments
        inside = moments[(moments > self._start) & (moments < self._end)]
        looked = np.concatenate(([self._start], inside, [self._end]))
        ends = self._forest.skeleton.in_root_space(self._samples.at(looked[[0, -1]]))
        is_still = shell_error(ends[:, 0], ends[:, 1], self._forest.radii).max() < STILL * tolerance
        exact = (ticks - inside * TICKS) / grid
        # A jump between two cells takes both of them, everything else the nearest.
        for cells in (np.rint(exact), np.concatenate((np.floor(exact), np.ceil(exact)))):
            cells = np.unique(cells.astype(int))[::-1]
            self._cells = cells[(cells > 0) & (cells * grid < delay - max(self._head.late - 1, 0))]
            self._grid = (ticks - self._cells * grid) / TICKS
            between = self._grid[np.abs(self._grid[:, None] - looked).min(axis=1) > NOTHING]
            self._moments = closely(np.unique(np.concatenate((looked, between))))[1:]
            if is_still:
                # It is to come to rest, and not to be put right again and again.
                self._moments = np.append(self._moments, self._end + BEYOND)
            self._truth = self._forest.skeleton.in_root_space(self._samples.at(self._moments))
            window, _, error = self._fitted()
            if error <= tolerance:
                break
        groups = np.array(window.numbers).tolist()
        return self._head._replace(finer=window.finer, cells=window.cells[1:], groups=groups), error <= tolerance

    def _fitted(self) -> Fitted:
        """Return the message with knots on the grid, of what is shown at the moments (n,) that are looked at."""
        tolerance, cells = self._codec.tolerance, [0]
        for finer in range(FINEST + 1):
            result = self._near(cells, finer)
            if result.error <= NEAR * tolerance:
                break
            cells = result.window.cells
        left = np.maximum(self._end - self._moments, 0.0) / (self._end - self._start)
        most = tolerance * np.minimum(AT_END + (1.0 - AT_END) * left / TAPER, 1.0)
        for margin in MARGINS:
            smaller = self._smaller(result, margin * most)
            if smaller.error <= max(tolerance, result.error):
                return smaller
        return result

    def _near(self, cells: list[int], finer: int) -> Fitted:
        """Return the numbers nearest to the truth, with knots and, where that is not enough, with more of them."""
        tolerance, most_knots = self._codec.tolerance, min(MOST_KNOTS, max(MOST_GROUPS // len(self._forest.groups), 1))
        window = Window(self._codec, self._base, self._head, finer)
        for cell in cells:
            window.say(cell, samples=self._samples)
        while True:
            result, errors = self._look(window)
            worst, free = self._moments[np.argmax(errors)], ~np.isin(self._cells, window.cells)
            if result.error <= NEAR * tolerance or not free.any() or len(window.cells) == most_knots:
                return result
            away = np.where(free, np.abs(self._grid - worst), np.inf)
            good = finer < FINEST or result.error <= tolerance
            if good and np.abs(window.moments[1:] - worst).min() < away.min():
                return result
            window.say(int(self._cells[np.argmin(away)]), samples=self._samples)

    def _look(self, window: Window) -> tuple[Fitted, np.ndarray]:
        """Return what is shown with a window, and the largest error of each moment within it."""
        path = window.path() if self._shown is None else self._shown.followed(window.path())
        inside = self._moments <= self._end
        errors = self._forest.errors(path.at(self._moments[inside]), self._truth[:, inside]).max(axis=0)
        return Fitted(window, path, float(errors.max())), errors

    def _smaller(self, result: Fitted, most: np.ndarray) -> Fitted:
        """Return a message with smaller numbers, with which no joint's error is more than `most` (n,)."""
        window, radii = result.window, self._forest.radii[:, None]
        there = self._forest.skeleton.in_root_space(result.path.at(self._moments))
        turn = multiply(there.quaternions, conjugate(self._truth.quaternions))
        turn = turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)
        # How far balls are off, and by how much their shells are turned: components first, and free to be written to.
        errors = np.stack(
            list(map(components, (there.positions - self._truth.positions, 2.0 * turn * radii[..., None])))
        )
        places, axes = np.array(components(there.positions), order="C"), matrices(there.quaternions)
        numbers, last = np.array(window.numbers), window.moments[-2]
        for own, support in zip(numbers[::-1], window.supports[::-1], strict=True):
            hat = window.factor * _hat(support, self._moments, self._end, last)
            for values, (joint, slide, _) in zip(own[::-1], self._forest.groups[::-1], strict=True):
                if not values.any():
                    continue
                hung, parent = self._forest.skeleton.below(joint), self._forest.parents[joint]
                if slide:
                    along = np.eye(3)[..., None] if parent < 0 else axes[:, :, parent]
                    does = np.zeros((2, 3, 3, 1, len(hat)))
                    does[0] = (along * (self._codec.slide_step * hat))[:, :, None]
                else:
                    about = (axes[:, :, joint] * (self._codec.turn_steps[joint] * hat))[:, :, None]
                    arms = (places[:, hung] - places[:, [joint]])[:, None]
                    does = np.stack([cross(about, arms), about * radii[hung]])
                _reduce(values, errors, hung, does, most)
        smaller = Window(self._codec, self._base, self._head, window.finer)
        for cell, own in zip(window.cells, numbers, strict=True):
            smaller.say(cell, own)
        return self._look(smaller)[0]


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
    fewer = smaller_than(values)
    before = errors[:, :, hung]
    after = before[:, :, None] + np.einsum("ca,ewahn->ewchn", (fewer - values).astype(np.float64), does)
    # Where it is off by more already, it may not become worse.
    good = (_off(after) <= np.maximum(most, _off(before))).all(axis=(1, 2))
    if good.any():
        first = int(np.argmax(good))
        values[:], errors[:, :, hung] = fewer[first], after[:, :, first]


def smaller_than(values: np.ndarray) -> np.ndarray:
    """Numbers (c, 3) that cost less than three, the least first."""
    result = np.where(CHOICES & (values != 0), values - np.sign(values), values)
    result = np.concatenate((np.zeros((1, 3), dtype=values.dtype), result))
    return result[(result != values).any(axis=1)]


def _off(errors: np.ndarray) -> np.ndarray:
    """Return by how much balls are off (...) of errors (2, 3, ...)."""
    return largest_displacement(errors[0], errors[1].copy(), np.array(0.5))


def _hat(support: tuple[float, float, float], moments: np.ndarray, end: float, last: float) -> np.ndarray:
    """How much of a knot's residual is in what is shown (n,), which beyond the end goes on as since `last`."""
    before, own, after = support
    line = (before, own, max(after, own + NOTHING)), (0.0, 1.0, float(after == own))
    ends, lasts = np.interp((end, last), *line)
    return np.interp(moments, *line) + (ends - lasts) / (end - last) * carried(moments - end)
