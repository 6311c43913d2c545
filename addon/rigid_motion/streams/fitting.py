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

    def window(self, codec: Codec, finer: int) -> Window:
        return Window(codec, self.state, self.kind, self.start, self.end, finer)


@dataclass(eq=False)
class Fitted:
    """A message that could be sent."""

    finer: int

    window: Window

    moments: list[float] = field(default_factory=list)
    """Of the knots besides the end, in their order."""

    numbers: list[np.ndarray] = field(default_factory=list)
    """Of each knot, the end first, shape (groups, 3)."""

    path: Path | None = None
    """What is shown with it."""

    error: float = np.inf
    """The largest within the window."""


class Fitting:
    """Finds what to say of a forest."""

    def __init__(self, codec: Codec) -> None:
        self.codec, self.tolerance = codec, codec.tolerance
        self._skeleton, self._radii = codec.forest.skeleton, codec.forest.radii
        self._below = [self._skeleton.below(joint) for joint in range(len(codec.forest))]
        self._most_knots = min(MOST_KNOTS, max(MOST_GROUPS // len(codec.walk), 1))

    def errors(self, shown: Poses, truth: Poses) -> np.ndarray:
        """Return the largest of all joints (n,), of poses (joints, n) in their parents' spaces and true ones in the
        root's.
        """
        return shell_error(self._skeleton.in_root_space(shown), truth, self._radii[:, None]).max(axis=0)

    def fitted(self, task: Task) -> Fitted:
        """Return the message for a task."""
        truth = self._skeleton.in_root_space(task.samples.at(task.moments))
        knots: list[float] = []
        for finer in range(FINEST + 1):
            result = self._near(task, truth, knots, finer)
            if result.error <= NEAR * self.tolerance:
                break
        left = np.maximum(task.end - task.moments, 0.0) / (task.end - task.start)
        most = self.tolerance * np.minimum(AT_END + (1.0 - AT_END) * left / TAPER, 1.0)
        for margin in MARGINS:
            smaller = self._smaller(task, truth, result, margin * most)
            if smaller.error <= max(self.tolerance, result.error):
                return smaller
        return result

    def _near(self, task: Task, truth: Poses, knots: list[float], finer: int) -> Fitted:
        """Return the numbers nearest to the truth, with knots and, where that is not enough, with more of them."""
        window = task.window(self.codec, finer)
        result = Fitted(finer, window, knots, [window.fit(task.samples.pose(task.end))])
        for moment in knots:
            result.numbers.append(window.fit(task.samples.pose(moment), moment))
        while True:
            errors = self._look(task, truth, result)
            worst = task.moments[np.argmax(errors)]
            free = task.grid[~np.isin(task.grid, window.moments)]
            if result.error <= NEAR * self.tolerance or not len(free) or len(knots) + 1 == self._most_knots:
                return result
            nearest = float(free[np.argmin(np.abs(free - worst))])
            good = finer < FINEST or result.error <= self.tolerance
            if good and np.abs(np.array(window.moments[1:]) - worst).min() < abs(nearest - worst):
                return result
            knots.append(nearest)
            result.numbers.append(window.fit(task.samples.pose(nearest), nearest))

    def _look(self, task: Task, truth: Poses, result: Fitted) -> np.ndarray:
        """Note what a message shows, and return the largest error of each moment (n,)."""
        path = result.window.path()
        result.path = path if task.path is None else task.path.followed(path)
        inside = task.moments <= task.end
        errors = self.errors(result.path.at(task.moments[inside]), truth[:, inside])
        result.error = float(errors.max())
        return errors

    def _smaller(self, task: Task, truth: Poses, result: Fitted, most: np.ndarray) -> Fitted:
        """Return a message with smaller numbers, with which no joint is off by more than `most` (n,)."""
        assert result.path is not None
        there = self._skeleton.in_root_space(result.path.at(task.moments))
        places, d = (_apart(part) for part in (there.positions, there.positions - truth.positions))
        turn = multiply(there.quaternions, conjugate(truth.quaternions))
        v = _apart(2.0 * turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)) * self._radii[:, None]
        axes, numbers, walk = matrices(there.quaternions), np.array(result.numbers), self.codec.walk
        for number in range(len(numbers) - 1, -1, -1):
            support = result.window.supports[number]
            hat = _hat(support, task.moments, task.end, max([task.start, *result.moments]))
            seen = np.flatnonzero(hat)
            if not len(seen):
                numbers[number] = 0
                continue
            near = [part[..., seen] for part in (d, v, places, axes)]
            for group in range(len(walk) - 1, -1, -1):
                if numbers[number, group].any():
                    does = self._does(group, near[2], near[3], 0.5**result.finer * hat[seen])
                    hung = self._below[walk.joints[group]]
                    _reduce(numbers[number, group], hung, near, does, most[seen] ** 2)
            d[..., seen], v[..., seen] = near[:2]
        window = task.window(self.codec, result.finer)
        for moment, own in zip([None, *result.moments], numbers, strict=True):
            window.say(own, moment)
        said = Fitted(result.finer, window, result.moments, list(numbers))
        self._look(task, truth, said)
        return said

    def _does(self, group: int, places: np.ndarray, axes: np.ndarray, hat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what one step of each number of a group does to what hangs on its joint.

        Returns
        -------
        moved, turned : array, shape (3 components, 3 numbers, hung, n)
            By how much places move, and the balls' shells turn.
        """
        joint = self.codec.walk.joints[group]
        hung, parent = self._below[joint], self._skeleton.parents[joint]
        if self.codec.walk.slides[group]:
            along = np.eye(3)[:, :, None] if parent < 0 else axes[:, :, parent]
            moved = np.broadcast_to((along * (self.codec.slide_step * hat))[:, :, None], (3, 3, len(hung), len(hat)))
            return moved, np.zeros_like(moved)
        about = (axes[:, :, joint] * (self.codec.turn_steps[joint] * hat))[:, :, None]
        arms = (places[:, hung] - places[:, [joint]])[:, None]
        return cross(about, arms), about * self._radii[hung][:, None]


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
