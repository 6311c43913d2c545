"""What a message says: as little as keeps every joint's ball within the tolerance, at all moments that are looked at.

First come knots, where they are needed most, and all their numbers as near to the truth as steps are fine. Then numbers
are made smaller one after another, from the ends of the limbs inwards, as long as the whole stays inside: a number that
is 0 costs next to nothing. What a number does to all that hangs on its joint is reckoned to first order, and the
outcome is looked at exactly. Arrays have joints first, (joints, n), and components before them where they are apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..motion import Poses, shell_error
from ..motion.quaternions import conjugate, cross, matrices, multiply
from .knots import FINEST, Scale, State, Window
from .paths import Path, carried, transposed
from .residuals import MOST_GROUPS, MOST_KNOTS

NEAR = 0.97
"""Part of the tolerance that rounding may use."""

MARGINS = (0.97, 0.85, 0.7)
"""Parts of the tolerance that smaller numbers may use, one after another, while the outcome is off by more."""

AT_END, TAPER = 0.85, 0.4
"""Part of that at the end of a window, from where the motion has to go on well by itself; from this part of it on."""

NOTHING = 1e-9
"""Seconds."""


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be said."""

    path: Path | None
    """What is shown so far."""

    state: State
    """What the message builds on, and how: a kind of `residuals`."""

    kind: int

    start: float
    """Of the window."""

    samples: Path

    end: float

    moments: np.ndarray
    """What is looked at, rising; the last ones are where motion and picture go on beyond the window. Shape (n,)."""

    grid: np.ndarray
    """Where knots may be, rising. Shape (k,)."""


@dataclass(eq=False)
class Fitted:
    """A message that could be sent."""

    finer: int

    moments: list[float] = field(default_factory=list)
    """Of the knots besides the end, in their order."""

    numbers: list[np.ndarray] = field(default_factory=list)
    """Of each knot, the end first, shape (groups, 3)."""

    supports: list[tuple[float, float, float]] = field(default_factory=list)

    path: Path | None = None
    """What is shown with it."""

    error: float = np.inf
    """The largest within the window."""


class Fitting:
    """Finds what to say of a forest."""

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self.skeleton, self.radii = scale.forest.skeleton, scale.forest.radii
        self._below = [self.skeleton.below(joint) for joint in range(len(scale.forest))]
        self._most_knots = min(MOST_KNOTS, max(MOST_GROUPS // len(scale.walk), 1))
        self._steps = np.zeros(len(scale.forest))
        self._steps[scale.turning] = scale.turn_steps

    def errors(self, shown: Poses, truth: Poses) -> np.ndarray:
        """Of poses (joints, n) in their parents' spaces, and true ones in the root's, shape (joints, n)."""
        return shell_error(self.skeleton.in_root_space(shown), truth, self.radii[:, None])

    def fitted(self, task: Task) -> Fitted:
        """Return the message for a task."""
        truth = self.skeleton.in_root_space(task.samples.at(task.moments))
        knots: list[float] = []
        for finer in range(FINEST + 1):
            result = self._near(task, truth, knots, finer)
            if result.error <= NEAR * self.scale.tolerance:
                break
        left = np.maximum(task.end - task.moments, 0.0) / (task.end - task.start)
        most = self.scale.tolerance * np.minimum(AT_END + (1.0 - AT_END) * left / TAPER, 1.0)
        for margin in MARGINS:
            smaller = self._smaller(task, truth, result, margin * most)
            if smaller.error <= max(self.scale.tolerance, result.error):
                return smaller
        return result

    def _near(self, task: Task, truth: Poses, knots: list[float], finer: int) -> Fitted:
        """Return the numbers nearest to the truth, with knots and, where that is not enough, with more of them."""
        result = Fitted(finer, moments=knots)
        window = Window(self.scale, task.state, task.kind, task.start, task.end, finer)
        result.numbers.append(window.fit(_at(task.samples, task.end)))
        for moment in knots:
            result.numbers.append(window.fit(_at(task.samples, moment), window.insert(moment)))
        while True:
            errors = self._look(task, truth, result, window)
            worst = task.moments[np.argmax(errors)]
            free = task.grid[~np.isin(task.grid, window.moments)]
            if result.error <= NEAR * self.scale.tolerance or not len(free) or len(knots) + 1 == self._most_knots:
                return result
            nearest = float(free[np.argmin(np.abs(free - worst))])
            good = finer < FINEST or result.error <= self.scale.tolerance
            if good and np.abs(np.array(window.moments[1:]) - worst).min() < abs(nearest - worst):
                return result
            knots.append(nearest)
            result.numbers.append(window.fit(_at(task.samples, nearest), window.insert(nearest)))

    def _said(self, task: Task, truth: Poses, like: Fitted, numbers: np.ndarray) -> Fitted:
        """Return a message with the knots of another, and other numbers (knots, groups, 3)."""
        said = Fitted(like.finer, like.moments, list(numbers))
        window = Window(self.scale, task.state, task.kind, task.start, task.end, like.finer)
        window.say(numbers[0])
        for moment, own in zip(like.moments, numbers[1:], strict=True):
            window.say(own, window.insert(moment))
        self._look(task, truth, said, window)
        return said

    def _look(self, task: Task, truth: Poses, result: Fitted, window: Window) -> np.ndarray:
        """Note what a window shows, and return the largest error of each moment (n,)."""
        path = window.path()
        result.path = path if task.path is None else task.path.followed(path)
        result.supports = window.supports
        inside = task.moments <= task.end
        errors = self.errors(result.path.at(task.moments[inside]), truth[:, inside]).max(axis=0)
        result.error = float(errors.max())
        return errors

    def _smaller(self, task: Task, truth: Poses, result: Fitted, most: np.ndarray) -> Fitted:
        """Return a message with smaller numbers, with which no joint is off by more than `most` (n,)."""
        assert result.path is not None
        there = self.skeleton.in_root_space(result.path.at(task.moments))
        places, d = (_apart(part) for part in (there.positions, there.positions - truth.positions))
        turn = multiply(there.quaternions, conjugate(truth.quaternions))
        v = _apart(2.0 * turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)) * self.radii[:, None]
        axes, numbers, walk = matrices(there.quaternions), np.array(result.numbers), self.scale.walk
        for number in range(len(numbers) - 1, -1, -1):
            hat = _hat(result.supports[number], task.moments, task.end, max([task.start, *result.moments]))
            seen = np.flatnonzero(hat)
            if not len(seen):
                numbers[number] = 0
                continue
            near = [part[..., seen] for part in (d, v, places, axes)]
            for group in range(len(walk) - 1, -1, -1):
                if numbers[number, group].any():
                    does = self._does(group, near[2], near[3], 0.5**result.finer * hat[seen])
                    self._reduce(numbers[number, group], walk.joints[group], near, does, most[seen] ** 2)
            d[..., seen], v[..., seen] = near[:2]
        return self._said(task, truth, result, numbers)

    def _does(self, group: int, places: np.ndarray, axes: np.ndarray, hat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what one step of each number of a group does to what hangs on its joint.

        Returns
        -------
        moved, turned : array, shape (3 components, 3 numbers, hung, n)
            By how much places move, and the balls' shells turn.
        """
        joint = self.scale.walk.joints[group]
        hung, parent = self._below[joint], self.skeleton.parents[joint]
        if self.scale.walk.slides[group]:
            along = np.eye(3)[:, :, None] if parent < 0 else axes[:, :, parent]
            moved = np.broadcast_to((along * (self.scale.slide_step * hat))[:, :, None], (3, 3, len(hung), len(hat)))
            return moved, np.zeros_like(moved)
        about = (axes[:, :, joint] * (self._steps[joint] * hat))[:, :, None]
        arms = (places[:, hung] - places[:, [joint]])[:, None]
        return cross(about, arms), about * self.radii[hung][:, None]

    def _reduce(
        self,
        values: np.ndarray,
        joint: int,
        near: list[np.ndarray],
        does: tuple[np.ndarray, np.ndarray],
        most: np.ndarray,
    ) -> None:
        """Put the smallest numbers that will do in the place of three, and what they do into the errors."""
        hung = self._below[joint]
        fewer = smaller_than(values)
        changes = (fewer - values).astype(np.float64)
        d, v = (
            part[:, None, hung] + np.einsum("ca,wahn->wchn", changes, own)
            for part, own in zip(near[:2], does, strict=True)
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
    towards = values - np.sign(values)
    taken = CHOICES & (values != 0)
    result = np.where(taken, towards, values)
    result = np.concatenate((np.zeros((1, 3), dtype=values.dtype), result))
    return result[(result != values).any(axis=1)]


CHOICES = np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
"""Which of three numbers are made smaller."""


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


def _at(samples: Path, moment: float) -> Poses:
    """Return the poses (joints,) of a moment."""
    return transposed(samples.at(np.array([moment])))[0]


def _apart(vectors: np.ndarray) -> np.ndarray:
    """Vectors (joints, n, 3) as components (3, joints, n) that may be written to."""
    return np.array(np.moveaxis(vectors, -1, 0), order="C")
