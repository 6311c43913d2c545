"""What a message says: as little as keeps every joint's ball within the tolerance, at all moments that are looked at.

First come knots, where they are needed most, and all their numbers as near to the truth as steps are fine. Then numbers
are made smaller one after another, from the ends of the limbs inwards, as long as the whole stays inside: a number that
is 0 costs next to nothing. What a number does to all that hangs on its joint is reckoned to first order, and the
outcome is looked at exactly. Arrays have joints first, (joints, n), and components before them where they are apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..motion.quaternions import conjugate, cross, matrices, multiply
from .messages import FINEST, Codec, State, Window
from .paths import Path, carried
from .residuals import MOST_GROUPS, MOST_KNOTS

NEAR = 0.97
"""Part of the tolerance that rounding may use."""

MARGINS = (0.97, 0.85, 0.7)
"""Parts of the tolerance that smaller numbers may use, one after another, while the outcome is off by more."""

AT_END, TAPER = 0.85, 0.4
"""Part of that at the end of a window, from where the motion has to go on well by itself; from this part of it on."""

NOTHING = 1e-9
"""Seconds."""

CHOICES = np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
"""Which of three numbers are made smaller."""


class Fitted(NamedTuple):
    """A message that could be sent, what is shown with it, and the largest error within the window."""

    window: Window
    path: Path
    error: float


@dataclass(eq=False)
class Fitting:
    """Finds what to say of a window."""

    codec: Codec

    shown: Path | None
    """What is shown so far."""

    state: State
    """What the message builds on, and how: a kind of `residuals`."""

    kind: int

    samples: Path

    start: float
    """Of the window."""

    end: float

    moments: np.ndarray
    """What is looked at, rising; the last ones are where motion and picture go on beyond the window. Shape (n,)."""

    grid: np.ndarray
    """Where knots may be, rising. Shape (k,)."""

    def __post_init__(self) -> None:
        self._forest, self._walk = self.codec.forest, self.codec.walk
        self._truth = self._forest.skeleton.in_root_space(self.samples.at(self.moments))

    def fitted(self) -> Fitted:
        """Return the message."""
        tolerance, knots = self.codec.tolerance, list[float]()
        for finer in range(FINEST + 1):
            result = self._near(knots, finer)
            if result.error <= NEAR * tolerance:
                break
        left = np.maximum(self.end - self.moments, 0.0) / (self.end - self.start)
        most = tolerance * np.minimum(AT_END + (1.0 - AT_END) * left / TAPER, 1.0)
        for margin in MARGINS:
            smaller = self._smaller(result, margin * most)
            if smaller.error <= max(tolerance, result.error):
                return smaller
        return result

    def _near(self, knots: list[float], finer: int) -> Fitted:
        """Return the numbers nearest to the truth, with knots and, where that is not enough, with more of them."""
        tolerance, most_knots = self.codec.tolerance, min(MOST_KNOTS, max(MOST_GROUPS // len(self._walk), 1))
        window = self._window(finer)
        for moment in (None, *knots):
            window.fit(self.samples.pose(self.end if moment is None else moment), moment)
        while True:
            path, errors = self._look(window)
            error, worst = float(errors.max()), self.moments[np.argmax(errors)]
            free = self.grid[~np.isin(self.grid, window.moments)]
            if error <= NEAR * tolerance or not len(free) or len(knots) + 1 == most_knots:
                return Fitted(window, path, error)
            nearest = float(free[np.argmin(np.abs(free - worst))])
            good = finer < FINEST or error <= tolerance
            if good and np.abs(np.array(window.moments[1:]) - worst).min() < abs(nearest - worst):
                return Fitted(window, path, error)
            knots.append(nearest)
            window.fit(self.samples.pose(nearest), nearest)

    def _window(self, finer: int) -> Window:
        return Window(self.codec, self.state, self.kind, self.start, self.end, finer)

    def _look(self, window: Window) -> tuple[Path, np.ndarray]:
        """Return what is shown with a window, and the largest error of each moment within it."""
        path = window.path() if self.shown is None else self.shown.followed(window.path())
        inside = self.moments <= self.end
        return path, self._forest.errors(path.at(self.moments[inside]), self._truth[:, inside]).max(axis=0)

    def _smaller(self, result: Fitted, most: np.ndarray) -> Fitted:
        """Return a message with smaller numbers, with which no joint is off by more than `most` (n,)."""
        there = self._forest.skeleton.in_root_space(result.path.at(self.moments))
        places, d = (_apart(part) for part in (there.positions, there.positions - self._truth.positions))
        turn = multiply(there.quaternions, conjugate(self._truth.quaternions))
        v = _apart(2.0 * turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)) * self._forest.radii[:, None]
        axes, window = matrices(there.quaternions), result.window
        numbers, last = np.array(window.numbers), max([self.start, *window.inner])
        for own, support in zip(numbers[::-1], window.supports[::-1], strict=True):
            hat = _hat(support, self.moments, self.end, last)
            seen = np.flatnonzero(hat)
            if not len(seen):
                own[:] = 0
                continue
            near = [part[..., seen] for part in (d, v, places, axes)]
            for group in range(len(self._walk) - 1, -1, -1):
                if own[group].any():
                    does = self._does(group, near[2], near[3], window.factor * hat[seen])
                    _reduce(own[group], self._forest.below[self._walk.joints[group]], near, does, most[seen] ** 2)
            d[..., seen], v[..., seen] = near[:2]
        smaller = self._window(window.finer)
        for moment, own in zip((None, *window.inner), numbers, strict=True):
            smaller.say(own, moment)
        path, errors = self._look(smaller)
        return Fitted(smaller, path, float(errors.max()))

    def _does(self, group: int, places: np.ndarray, axes: np.ndarray, hat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what one step of each number of a group does to what hangs on its joint.

        Returns
        -------
        moved, turned : array, shape (3 components, 3 numbers, hung, n)
            By how much places move, and the balls' shells turn.
        """
        joint = self._walk.joints[group]
        hung, parent = self._forest.below[joint], self._forest.parents[joint]
        if self._walk.slides[group]:
            along = np.eye(3)[:, :, None] if parent < 0 else axes[:, :, parent]
            moved = np.broadcast_to((along * (self.codec.slide_step * hat))[:, :, None], (3, 3, len(hung), len(hat)))
            return moved, np.zeros_like(moved)
        about = (axes[:, :, joint] * (self.codec.turn_steps[joint] * hat))[:, :, None]
        arms = (places[:, hung] - places[:, [joint]])[:, None]
        return cross(about, arms), about * self._forest.radii[hung][:, None]


def _reduce(
    values: np.ndarray,
    hung: np.ndarray,
    near: list[np.ndarray],
    does: tuple[np.ndarray, np.ndarray],
    most: np.ndarray,
) -> None:
    """Put the smallest numbers that will do in the place of three, and what they do into the errors."""
    fewer = smaller_than(values)
    changes = (fewer - values).astype(np.float64)
    d, v = (
        part[:, None, hung] + np.einsum("ca,wahn->wchn", changes, own) for part, own in zip(near[:2], does, strict=True)
    )
    # Where it is off by more already, it may not become worse.
    most = np.maximum(most, _squared_errors(near[0][:, hung], near[1][:, hung]))
    good = (_squared_errors(d, v) <= most).all(axis=(1, 2))
    if good.any():
        first = int(np.argmax(good))
        values[:] = fewer[first]
        near[0][:, hung], near[1][:, hung] = d[:, first], v[:, first]


def smaller_than(values: np.ndarray) -> np.ndarray:
    """Numbers (c, 3) that cost less than three, the least first."""
    result = np.where(CHOICES & (values != 0), values - np.sign(values), values)
    result = np.concatenate((np.zeros((1, 3), dtype=values.dtype), result))
    return result[(result != values).any(axis=1)]


def _squared_errors(d: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Of balls that are off by d (3, ...), and whose shells are turned by v: see `motion.shell_error`."""
    across = cross(d, v)
    return (d * d).sum(axis=0) + (v * v).sum(axis=0) + 2.0 * np.sqrt((across * across).sum(axis=0))


def _hat(support: tuple[float, float, float], moments: np.ndarray, end: float, last: float) -> np.ndarray:
    """How much of a knot's residual is in what is shown (n,), which beyond the end goes on as since `last`."""
    before, own, after = support
    line = (before, own, max(after, own + NOTHING)), (0.0, 1.0, float(after == own))
    ends, lasts = np.interp((end, last), *line)
    return np.interp(moments, *line) + (ends - lasts) / (end - last) * carried(moments - end)


def _apart(vectors: np.ndarray) -> np.ndarray:
    """Vectors (joints, n, 3) as components (3, joints, n) that may be written to."""
    return np.array(np.moveaxis(vectors, -1, 0), order="C")
