"""Blender's own F-curves with Auto Clamped handles: the motion without any mode, to compare the modes with.

Blender joins new keys by Bezier curves with *Auto Clamped* handles, separately for x, y, z and the four numbers of the
quaternion. The handles are a third of the segment long, so the curves are cubics in time, and the handles set slopes.
Slopes are zero at the first key, the last key, and wherever a value is not between those of its neighbours. Between
these keys the second derivative is continuous (*Continuous Acceleration*), as far as no slope has to be negative for
it, or more than three times that of the line to either neighbour: there a curve would leave the range between its keys.

Source: the manual of Blender, "Editors - Graph Editor - F-Curves". Tests check that the result equals Blender's own
evaluation.
"""

from __future__ import annotations

import numpy as np

MAX_SLOPE_RATIO = 3.0
"""How many times steeper than the line from key to key a cubic may be at either end without leaving the keys' range."""

MAX_UNLOCKED_SLOPES = 2
"""How often Blender releases a slope that is locked at its limit, at most."""


def auto_clamped_slopes(durations: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the slopes of curves at their keys, for Blender's Auto Clamped handles.

    Parameters
    ----------
    durations : array, shape (..., n - 1)
        From key to key, above zero. Leading axes of `values` may be missing here.
    values : array, shape (..., n)

    Returns
    -------
    array, shape (..., n)
    """
    shape = values.shape
    chords, durations = np.diff(values) / durations, np.broadcast_to(durations, (*shape[:-1], shape[-1] - 1))
    before, after = chords[..., :-1], chords[..., 1:]
    fixed = np.ones(shape, dtype=bool)
    fixed[..., 1:-1] = before * after <= 0.0
    free = np.flatnonzero(~fixed.ravel())
    result = np.zeros(values.size)
    if len(free):
        inner = ~fixed[..., 1:-1]
        sides = [
            (chord[inner], 1.0 / duration[inner])
            for chord, duration in ((before, durations[..., :-1]), (after, durations[..., 1:]))
        ]
        result[free] = _Runs(free).clamped(*sides)
    return result.reshape(shape)


class _Runs:
    """Runs of neighbouring keys (k,) with free slopes that depend on one another; `places` are indices among
    all keys.
    """

    def __init__(self, places: np.ndarray) -> None:
        begins = np.diff(places, prepend=-2) > 1
        self.first = np.flatnonzero(begins)
        self.run = np.cumsum(begins) - 1
        number = np.arange(len(places)) - self.first[self.run]
        order = np.argsort(number, kind="stable")
        # The first keys of all runs, then the second ones, and so on.
        self.columns = np.split(order, np.flatnonzero(np.diff(number[order])) + 1)

    def clamped(self, before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Return the slopes (k,).

        `before` and `after` each hold the slope of the line to the neighbour on that side, and one over the time to it,
        (k,).
        """
        (chord, lower), (next_chord, upper) = before, after
        sign = np.sign(chord)
        diagonal, right = 2.0 * (lower + upper), 3.0 * sign * (chord * lower + next_chord * upper)
        most = MAX_SLOPE_RATIO * np.minimum(np.abs(chord), np.abs(next_chord))
        locked, at, unlocks = np.zeros(len(sign), dtype=bool), np.zeros(len(sign)), np.zeros(len(sign), dtype=int)
        while True:
            slopes = self._solve(lower, diagonal, upper, right, locked, at)
            high, low = slopes > most, slopes < 0.0
            # In a run with slopes that are too steep, only those are locked at their limit.
            held = high | (low & ~self._any_in_run(high))
            pull = right - diagonal * slopes - self._neighbour_terms(lower, upper, slopes)
            loose = locked & (unlocks < MAX_UNLOCKED_SLOPES) & ~self._any_in_run(high | low)
            loose &= ((pull > 0.0) & (slopes < most)) | ((pull < 0.0) & (slopes > 0.0))
            if not (held.any() or loose.any()):
                return sign * slopes
            locked, at = (locked | held) & ~loose, np.where(held, np.where(high, most, 0.0), at)
            unlocks += loose

    def _any_in_run(self, flags: np.ndarray) -> np.ndarray:
        """Return for each key whether any key in its run has the flag, (k,)."""
        return np.logical_or.reduceat(flags, self.first)[self.run]

    def _neighbour_terms(self, lower: np.ndarray, upper: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return what the neighbours in a key's run contribute to its equation, (k,)."""
        same = self.run[1:] == self.run[:-1]
        result = np.zeros(len(slopes))
        result[1:] += np.where(same, lower[1:] * slopes[:-1], 0.0)
        result[:-1] += np.where(same, upper[:-1] * slopes[1:], 0.0)
        return result

    def _solve(
        self,
        lower: np.ndarray,
        diagonal: np.ndarray,
        upper: np.ndarray,
        right: np.ndarray,
        locked: np.ndarray,
        at: np.ndarray,
    ) -> np.ndarray:
        """Return the solution (k,) of each run's tridiagonal system, where `locked` keys have the value `at`."""
        lower, upper = (np.where(locked, 0.0, side) for side in (lower, upper))
        diagonal, right = np.where(locked, 1.0, diagonal), np.where(locked, at, right)
        share, result = np.empty(len(right)), np.empty(len(right))
        for number, keys in enumerate(self.columns):
            rest, done = diagonal[keys], right[keys]
            if number:
                rest = rest - lower[keys] * share[keys - 1]
                done = done - lower[keys] * result[keys - 1]
            share[keys], result[keys] = upper[keys] / rest, done / rest
        for keys in reversed(self.columns):
            keys = keys[np.append(self.run, -1)[keys + 1] == self.run[keys]]
            result[keys] -= share[keys] * result[keys + 1]
        return result
