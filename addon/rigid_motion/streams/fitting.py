"""What a message says: as little as keeps every joint's ball within the tolerance, at all samples of its window.

All that is said is rounded first, and then numbers are let go one after another, from the ends of the limbs inwards,
as long as the whole stays inside. What a number does to the joints that hang on it is reckoned to first order, and the
outcome is looked at exactly. Arrays have joints first: (joints, n), as in `rigid_motion.motion.skeletons`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..motion import Poses, shell_error
from ..motion.measures import largest_displacement
from ..motion.quaternions import conjugate, matrices, multiply
from .knots import FINEST, Scale, State, Window
from .paths import Path, transposed
from .residuals import MOST_KNOTS

MARGINS = (0.97, 0.85, 0.7)
"""Parts of the tolerance that letting go may use, one after another, where the outcome is off by more than that."""


GOOD, END, TAPER = 0.97, 0.7, 0.4


class Fitted:
    """A message that could be sent."""

    def __init__(self, window: Window, moments: list[float], numbers: list[np.ndarray], finer: int) -> None:
        self.window, self.moments, self.numbers, self.finer = window, moments, numbers, finer
        self.path: Path | None = None
        self.error = np.inf


class Fitting:
    """Finds what to say of a forest."""

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self.skeleton = scale.forest.skeleton
        self.radii = scale.forest.radii
        self.below = [self.skeleton.below(joint) for joint in range(len(scale.forest))]

    def errors(self, shown: Poses, truth: Poses) -> np.ndarray:
        """Of poses (joints, n) in their parents' spaces, and true ones in the root's, shape (joints, n)."""
        return shell_error(self.skeleton.in_root_space(shown), truth, self.radii[:, None])

    def fitted(self, path: Path | None, state: State, kind: int, start: float, samples: Path, moments: np.ndarray, grid: np.ndarray) -> Fitted:
        """The window from `start` to the last of the moments (n,) that are looked at, of samples.

        Knots are among the moments of the grid (k,), rising.
        """
        local = samples.at(moments)
        truth = self.skeleton.in_root_space(local)
        end = float(moments[-1])
        ends, worst, finer, inner = transposed(samples.at(np.array([end])))[0], np.inf, 0, []
        free = grid[(grid > start) & (grid < end)]
        while True:
            window = Window(self.scale, state, kind, start, end, finer)
            numbers = [window.fit(ends)]
            for moment in inner:
                numbers.append(window.fit(transposed(samples.at(np.array([moment])))[0], window.insert(moment)))
            while True:
                shown = path.followed(window.path()) if path else window.path()
                errors = self.errors(shown.at(moments), truth).max(axis=0)
                if errors.max() <= GOOD * self.scale.tolerance or not len(free) or len(numbers) == MOST_KNOTS:
                    break
                nearest = int(np.argmin(np.abs(free - moments[np.argmax(errors)])))
                taken = np.array(window.moments[1:])
                if np.abs(taken - moments[np.argmax(errors)]).min() < np.abs(free[nearest] - moments[np.argmax(errors)]):
                    break
                inner.append(float(free[nearest]))
                free = np.delete(free, nearest)
                numbers.append(window.fit(transposed(samples.at(np.array([inner[-1]])))[0], window.insert(inner[-1])))
            if errors.max() <= GOOD * self.scale.tolerance or finer == FINEST:
                break
            finer += 1
        found = Fitted(window, inner, numbers, finer)
        found.path, found.error = shown, errors.max()
        limits = self.scale.tolerance * np.minimum(
            1.0, END + (1 - END) * (moments[-1] - moments) / TAPER / (moments[-1] - start)
        )
        for margin in MARGINS:
            less = self._less(found, start, moments, local, truth, margin * limits)
            tried = self.said(path, state, kind, start, end, inner, less, finer)
            tried.error = self.errors(tried.path.at(moments), truth).max()
            if tried.error <= max(self.scale.tolerance, found.error):
                return tried
        return found

    def said(
        self, path: Path | None, state: State, kind: int, start: float, end: float, inner: list[float], numbers: list[np.ndarray], finer: int
    ) -> Fitted:
        window = Window(self.scale, state, kind, start, end, finer)
        window.say(numbers[0])
        for moment, knot in zip(inner, numbers[1:], strict=True):
            window.say(knot, window.insert(moment))
        said = Fitted(window, inner, numbers, finer)
        said.path = path.followed(window.path()) if path else window.path()
        return said

    def _less(
        self, fitted: Fitted, start: float, moments: np.ndarray, local: Poses, truth: Poses, most: np.ndarray
    ) -> list[np.ndarray]:
        """The numbers of a message without those that are not needed."""
        groups, window, finer = np.array(fitted.numbers), fitted.window, 0.5**fitted.finer
        there = self.skeleton.in_root_space(fitted.path.at(moments))
        places = np.ascontiguousarray(np.moveaxis(there.positions, -1, 0))
        d = np.ascontiguousarray(np.moveaxis(there.positions - truth.positions, -1, 0))
        turn = multiply(there.quaternions, conjugate(truth.quaternions))
        v = np.moveaxis(2.0 * turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0), -1, 0) * self.radii[:, None]
        axes = matrices(there.quaternions)
        hats = hat_functions(window.supports, moments)
        walk, parents = self.scale.walk, self.skeleton.parents
        turn_steps = np.zeros(len(self.skeleton))
        turn_steps[self.scale.turning] = self.scale.turn_steps
        for number in range(len(groups) - 1, -1, -1):
            seen = hats[number] > 0.0
            if not seen.any():
                groups[number] = 0
                continue
            hat = hats[number][seen]
            order = [group for group in range(len(walk) - 1, -1, -1) if groups[number, group].any()]
            for group in order:
                joint, values = walk.joints[group], groups[number, group]
                hung = self.below[joint]
                for less in lesser(values):
                    change = (np.array(less) - values).astype(np.float64)
                    if walk.slides[group]:
                        change *= self.scale.slide_step * finer
                        above = parents[joint]
                        world = change[:, None] * hat if above < 0 else np.tensordot(
                            axes[:, :, above][:, :, seen], change, axes=(1, 0)
                        ) * hat
                        moved = np.broadcast_to(world[:, None, :], (3, len(hung), len(hat)))
                        new_d, new_v = d[:, hung][:, :, seen] + moved, v[:, hung][:, :, seen]
                    else:
                        change *= turn_steps[joint] * finer
                        world = np.tensordot(axes[:, :, joint][:, :, seen], change, axes=(1, 0)) * hat
                        arms = places[:, hung][:, :, seen] - places[:, joint][:, seen][:, None]
                        new_d = d[:, hung][:, :, seen] + np.cross(world[:, None], arms, axis=0)
                        new_v = v[:, hung][:, :, seen] + world[:, None] * self.radii[hung][:, None]
                    squared = (new_d * new_d).sum(0) + (new_v * new_v).sum(0)
                    squared += 2.0 * np.sqrt((np.cross(new_d, new_v, axis=0) ** 2).sum(0))
                    if (squared <= (most * most)[seen]).all():
                        groups[number, group] = less
                        d[np.ix_(range(3), hung, seen)] = new_d
                        v[np.ix_(range(3), hung, seen)] = new_v
                        break
        return list(groups)


def lesser(values: np.ndarray) -> list[tuple[int, int, int]]:
    """Numbers that cost less than these three, the least first."""
    a, b, c = values.tolist()
    found = [(0, 0, 0)]
    towards = lambda x: x - (x > 0) + (x < 0)
    found += [(towards(a), towards(b), towards(c))]
    found += [(towards(a), towards(b), c), (towards(a), b, towards(c)), (a, towards(b), towards(c))]
    found += [(towards(a), b, c), (a, towards(b), c), (a, b, towards(c))]
    return [few for few in dict.fromkeys(found) if few != (a, b, c)]


def hat_functions(supports: list[tuple[float, float, float]], moments: np.ndarray) -> np.ndarray:
    """How much each knot's residual does at moments (n,), shape (knots, n)."""
    return np.array([np.interp(moments, (start, own, max(end, own + 1e-9)), (0.0, 1.0, 1.0 if end == own else 0.0)) for start, own, end in supports])
