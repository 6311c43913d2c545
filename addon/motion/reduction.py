"""Key reduction: the few samples of a recording that, as keys of a mode, reproduce its motion.

A key is a pose: all channels together. Keys are taken out as long as the motion stays near enough to the recording,
those first that matter least, many at a time where they do not influence the same segments; then the rest are moved
along the recording to where the error is smallest, which lets more of them go, and so on. A key changes the segments
around it alone, so that all keys can be tried at once, and the work grows with the length of the recording and not
with its square.

Source: keys are taken out as knots are from splines in Lyche and Mørken, "Knot removal for parametric B-spline curves
and surfaces", 1987; the measure is that of the Animation Compression Library, see `addon.motion.measures`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from .measures import shell_error
from .modes import MODES, in_betweens, interpolate
from .poses import LIMIT, SHORTEST, Poses, beyond
from .quaternions import align_signs

PEAK = 8
"""The power of errors whose sum stands for the largest of them."""

STEPS = (1, -1, 2, -2, 4, -4, 8, -8)
"""By how many samples keys are moved, on trial."""

ROUNDS = 12
"""Of moving keys and taking out more of them, at most."""

LOOSER = (1.3, 1.6, 1.15)
"""How many times the tolerance a search begins with, before keys are put back where the motion is off."""

WORST = 1e30
"""Errors are clipped to this, so that their powers stay finite."""

BATCH = 2**14
"""Samples looked at in one go: few enough for the processor's caches."""


def reduce_keys(
    times: np.ndarray,
    poses: Poses,
    mode: str = "motor_spline",
    tolerance: float | None = None,
    radius: float = 0.1,
    *,
    budget: int | None = None,
    rms: bool = False,
    tries: int = 2,
) -> np.ndarray:
    """The fewest samples that keep the shell error of a mode within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array, shape (n,)
        Seconds, strictly rising.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    mode : str
        One of `MODES`.
    tolerance : float, optional
        The largest shell error anywhere, in the unit of the positions; with `rms` the root mean square over all
        samples.
    radius : float
        Of the shell, in the unit of the positions.
    budget : int, optional
        The most keys, at least 2, instead of a tolerance: the error is then as small as can be found.
    rms : bool
        Go by the root mean square of the shell error instead of the largest.
    tries : int
        How many times the search begins anew with a looser tolerance, and puts keys back where the motion is off: up to
        three, each of which takes about twice as long as the first search. Under `rms` it gains nothing, so it is off.

    Returns
    -------
    array of int, shape (k,)
        Rising, the first and the last sample among them.

    Raises
    ------
    ValueError
        Where it is not one of tolerance and budget that is given, or either is no sensible number, or a sample is not
        finite, out of order or of no size.
    """
    if (tolerance is None) == (budget is None):
        raise ValueError("key reduction needs either a tolerance or a budget of keys")
    if mode not in MODES:
        raise ValueError(f"there is no mode {mode!r}; the modes are {', '.join(MODES)}")
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ValueError(f"a tolerance of {tolerance} is not a positive number")
    if budget is not None and budget < 2:
        raise ValueError(f"a budget of {budget} keys is too small: a motion begins and ends with one")
    times = np.asarray(times, dtype=np.float64)
    if times.shape != poses.shape:
        raise ValueError(f"{times.size} times do not fit poses of shape {poses.shape}")
    numbers = np.column_stack((times, poses.positions, poses.quaternions))
    finite = (np.abs(numbers) < LIMIT).all(axis=1)
    if not finite.all():
        raise ValueError(f"sample {int(np.argmin(finite))} is not finite, or has a number beyond {LIMIT:g}")
    if poses.scales is not None and not (sound := (poses.scales > 1.0 / LIMIT) & (poses.scales < LIMIT)).all():
        raise ValueError(f"sample {int(np.argmin(sound))} has a scale that is not a positive number")
    if np.any(early := np.diff(times) <= SHORTEST):
        raise ValueError(f"sample {int(np.argmax(early)) + 1} is not later than the one before it")
    if len(times) <= 2:
        return np.arange(len(times))
    poses = Poses(poses.positions, align_signs(poses.quaternions), poses.scales)
    reduction = _Reduction(times, poses, mode, radius, 2 if rms else PEAK)
    if tolerance is not None:
        return reduction.within(tolerance, tries)
    return reduction.within_budget(budget)


@dataclass(eq=False)
class _Keys:
    """Keys among the samples, and what lies between them."""

    indices: np.ndarray
    """Samples, shape (k,)."""

    cost: np.ndarray
    """The sum of powers of the errors in each segment, shape (k - 1,)."""

    peak: np.ndarray
    """The largest error in each segment, shape (k - 1,)."""


class _Reduction:
    """The search for keys of one recording under one mode."""

    def __init__(self, times: np.ndarray, poses: Poses, mode: str, radius: float, power: int) -> None:
        self.times, self.poses, self.mode, self.radius, self.power = times, poses, mode, radius, power
        self.reach = max(MODES[mode].behind, MODES[mode].ahead)
        """How many segments beyond the two next to it a key influences, on either side."""
        self.spacing = 2 + 2 * self.reach
        """Keys this far from one another, or further, can be tried without regard to each other."""

    def within(self, tolerance: float, tries: int) -> np.ndarray:
        """Few samples that, as keys, keep to a tolerance."""
        all_samples = np.arange(len(self.times))
        best = self._refined(self._thinned(self._measured(all_samples), tolerance, 2), tolerance)
        for factor in LOOSER[:tries] if self.power != 2 else ():
            loose = factor * tolerance
            keys = self._refined(self._thinned(self._measured(all_samples), loose, 2), loose)
            keys = self._refined(self._densified(keys, tolerance), tolerance)
            if len(keys.indices) < len(best.indices) and keys.peak.max() <= tolerance:
                best = keys
        return best.indices

    def _densified(self, keys: _Keys, tolerance: float) -> _Keys:
        """Keys with more of them where the motion is off, each where it is so most, until it keeps to the tolerance."""
        while keys.peak.max() > tolerance:
            shown = interpolate(self.times[keys.indices], self.poses[keys.indices], self.times, self.mode)
            errors = shell_error(shown, self.poses, self.radius)
            errors[keys.indices] = -1.0
            of_segments = np.maximum.reduceat(errors, keys.indices[:-1])
            counts = np.diff(keys.indices, append=len(errors))
            worst = errors == np.append(of_segments, 0.0).repeat(counts)
            off = np.append(of_segments > tolerance, False).repeat(counts)
            if not np.any(worst & off):
                break  # It is off by no more than rounding.
            keys = self._measured(np.union1d(keys.indices, np.flatnonzero(worst & off)))
        return keys

    def _refined(self, keys: _Keys, tolerance: float) -> _Keys:
        """Keys moved and thinned until none can be removed."""
        for _ in range(ROUNDS):
            before = len(keys.indices)
            keys = self._thinned(self._moved(keys, tolerance), tolerance, 2)
            if len(keys.indices) == before:
                break
        return keys

    def within_budget(self, budget: int) -> np.ndarray:
        """So many samples that are keys with as small an error as can be found."""
        keys = self._thinned(self._measured(np.arange(len(self.times))), math.inf, budget)
        for _ in range(ROUNDS):
            before = keys.cost.sum()
            keys = self._moved(keys, math.inf)
            if not keys.cost.sum() < 0.99 * before:
                break
        return keys.indices

    def _measured(self, indices: np.ndarray) -> _Keys:
        """Keys at these samples, everything between them measured."""
        reach = self.reach
        columns = np.arange(-reach, 2 + reach)
        segments = np.arange(len(indices) - 1)
        windows = self._windows(indices, segments, columns)
        cost, peak = self._evaluate(windows, slice(reach, reach + 1))
        return _Keys(indices, cost[:, 0], peak[:, 0])

    def _thinned(self, keys: _Keys, tolerance: float, fewest: int) -> _Keys:
        """Keys without all those that can be removed, down to the fewest that are wanted."""
        reach = self.reach
        columns = np.concatenate((np.arange(-1 - 2 * reach, 0), np.arange(1, 2 + 2 * reach)))
        seen = np.zeros(len(keys.indices), dtype=bool)
        cost, peak = np.zeros((2, len(keys.indices), 1 + 2 * reach))
        while len(keys.indices) > fewest:
            unseen = np.flatnonzero(~seen[1:-1]) + 1
            if len(unseen):
                found = self._evaluate(self._windows(keys.indices, unseen, columns), slice(reach, 1 + 3 * reach))
                cost[unseen], peak[unseen] = found
                seen[unseen] = True
            inner = np.arange(1, len(keys.indices) - 1)
            rise = cost[inner].sum(axis=1) - self._around(keys.cost, inner)
            picked = inner[self._removable(rise, peak[inner].max(axis=1), keys, tolerance, len(inner) + 2 - fewest)]
            if not len(picked):
                break
            self._remove(keys, picked, cost, peak)
            left = np.ones(len(seen), dtype=bool)
            left[picked] = False
            near = (picked[:, None] + np.arange(-2 - 3 * reach, 3 + 3 * reach)).ravel()
            seen[near[(near >= 0) & (near < len(seen))]] = False
            seen, cost, peak = seen[left], cost[left], peak[left]
        return keys

    def _removable(self, rise: np.ndarray, peak: np.ndarray, keys: _Keys, tolerance: float, most: int) -> np.ndarray:
        """Which of the inner keys go next: those whose removal raises the cost least, far enough from one another."""
        order = np.argsort(rise, kind="stable")
        order = order[: max(1, len(order) // 4)] if self.power == 2 or not math.isfinite(tolerance) else order
        if self.power != 2:
            order = order[peak[order] <= tolerance]
            order = order[: max(1, len(rise) // 4)]
        picked = _spaced(order, self.spacing, len(rise))[:most]
        if self.power == 2 and math.isfinite(tolerance):
            picked = picked[keys.cost.sum() + np.cumsum(rise[picked]) <= tolerance**2 * len(self.times)]
        return picked

    def _remove(self, keys: _Keys, picked: np.ndarray, cost: np.ndarray, peak: np.ndarray) -> None:
        """Remove these keys, and set the costs and peaks of the segments that take their place."""
        reach = self.reach
        segments = picked[:, None] + np.concatenate((np.arange(-1 - reach, 0), np.arange(1, 1 + reach)))
        valid = (segments >= 0) & (segments < len(keys.cost))
        keys.cost[segments[valid]], keys.peak[segments[valid]] = cost[picked][valid], peak[picked][valid]
        keys.indices = np.delete(keys.indices, picked)
        keys.cost, keys.peak = np.delete(keys.cost, picked), np.delete(keys.peak, picked)

    def _moved(self, keys: _Keys, tolerance: float) -> _Keys:
        """As many keys, moved along the recording as long as that lowers the cost by much."""
        reach = self.reach
        columns = np.arange(-1 - 2 * reach, 2 + 2 * reach)
        offsets = np.arange(-1 - reach, 1 + reach)
        for step in STEPS:
            indices = keys.indices
            inner = np.arange(1, len(indices) - 1)
            moved = indices[inner] + step
            inner = inner[(moved > indices[inner - 1]) & (moved < indices[inner + 1])]
            if not len(inner):
                continue
            windows = self._windows(indices, inner, columns)
            windows[:, 1 + 2 * reach] += step
            cost, peak = self._evaluate(windows, slice(reach, 2 + 3 * reach))
            rise = cost.sum(axis=1) - self._around(keys.cost, inner)
            allowed = (self.power == 2) | (peak.max(axis=1) <= tolerance)
            good = np.flatnonzero((rise < -1e-4 * keys.cost.mean()) & allowed)
            chosen = good[np.argsort(rise[good], kind="stable")]
            picked = _spaced(inner[chosen], self.spacing, len(indices))
            rows = np.searchsorted(inner, picked)
            segments = picked[:, None] + offsets
            valid = (segments >= 0) & (segments < len(keys.cost))
            keys.cost[segments[valid]], keys.peak[segments[valid]] = cost[rows][valid], peak[rows][valid]
            keys.indices = indices.copy()
            keys.indices[picked] += step
        return keys

    def _around(self, of_segments: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """The sum over the segments that each key influences."""
        sums = np.concatenate(((0.0,), np.cumsum(of_segments)))
        last = len(of_segments)
        return sums[np.minimum(inner + 1 + self.reach, last)] - sums[np.maximum(inner - 1 - self.reach, 0)]

    def _windows(self, indices: np.ndarray, centres: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """The samples of the keys in these columns from each centre, -1 where there are none, shape (c, m)."""
        numbers = centres[:, None] + columns
        inside = (numbers >= 0) & (numbers < len(indices))
        return np.where(inside, indices[np.clip(numbers, 0, len(indices) - 1)], -1)

    def _evaluate(self, windows: np.ndarray, segments: slice) -> tuple[np.ndarray, np.ndarray]:
        """Costs and peaks, each (c, s), of some of the segments between the keys of windows (c, m)."""
        wanted = windows[:, segments], windows[:, segments.start + 1 : segments.stop + 1]
        counts = np.where((wanted[0] >= 0) & (wanted[1] >= 0), wanted[1] - wanted[0] - 1, 0)
        cost, peak = np.zeros((2, *counts.shape))
        ends = np.cumsum(counts.sum(axis=1))
        cuts = np.unique(np.append(np.searchsorted(ends, np.arange(0, ends[-1], BATCH)), len(windows)))
        for first, last in itertools.pairwise(cuts.tolist()):
            batch = slice(first, last)
            self._evaluate_batch(windows[batch], segments.start, counts[batch], cost[batch], peak[batch])
        return cost, peak

    def _evaluate_batch(
        self, windows: np.ndarray, start: int, counts: np.ndarray, cost: np.ndarray, peak: np.ndarray
    ) -> None:
        nonempty = np.flatnonzero(counts.sum(axis=1))
        if not len(nonempty):
            return
        all_counts = np.zeros((len(nonempty), windows.shape[1] - 1), dtype=np.int64)
        all_counts[:, start : start + counts.shape[1]] = counts[nonempty]
        segment = np.repeat(np.arange(all_counts.size), all_counts.ravel())
        begins = windows[nonempty, :-1].ravel()
        first = np.cumsum(all_counts.ravel()) - all_counts.ravel()
        samples = begins[segment] + 1 + np.arange(len(segment)) - first[segment]
        key_times, keys = _with_ends(self.times, self.poses, windows[nonempty])
        start_times, durations = key_times[:, :-1].ravel(), np.diff(key_times).ravel()
        progress = (self.times[samples] - start_times[segment]) / durations[segment]
        shown = in_betweens(key_times, keys, all_counts, progress, self.mode)
        error = np.minimum(shell_error(shown, self.poses[samples], self.radius), WORST)
        filled = np.flatnonzero(all_counts.ravel())
        sums, largest = np.zeros((2, all_counts.size))
        sums[filled] = np.add.reduceat(error**self.power, first[filled])
        largest[filled] = np.maximum.reduceat(error, first[filled])
        wanted = slice(start, start + counts.shape[1])
        cost[nonempty] = sums.reshape(all_counts.shape)[:, wanted]
        peak[nonempty] = largest.reshape(all_counts.shape)[:, wanted]


def _spaced(order: np.ndarray, distance: int, count: int) -> np.ndarray:
    """Of the numbers below `count`, in the order of their worth, those that are `distance` from any better one."""
    rank = np.full(count + 2 * distance, len(order))
    rank[order + distance] = np.arange(len(order))
    picked: list[np.ndarray] = []
    # All at once that are the best in their neighbourhood, and again with what is left.
    while True:
        windows = np.lib.stride_tricks.sliding_window_view(rank, 2 * distance - 1)
        best = windows.min(axis=1)
        centre = rank[distance - 1 : distance - 1 + len(best)]
        chosen = np.flatnonzero((centre == best) & (centre < len(order)))
        if not len(chosen):
            break
        picked.append(chosen - 1)
        near = chosen[:, None] + distance - 1 + np.arange(1 - distance, distance)
        rank[near.ravel()] = len(order)
    found = np.concatenate(picked) if picked else np.empty(0, dtype=np.int64)
    ranks = np.empty(count, dtype=np.int64)
    ranks[order] = np.arange(len(order))
    return found[np.argsort(ranks[found])]


def _with_ends(times: np.ndarray, poses: Poses, windows: np.ndarray) -> tuple[np.ndarray, Poses]:
    """Times and poses (c, m) of these samples; where there are none, the motion goes on as in the outermost segment."""
    outside = windows < 0
    indices = np.maximum(windows, 0)
    key_times, keys = times[indices], poses[indices]
    last = windows.shape[1] - 1
    columns = [(column, 1) for column in range(last - 2, -1, -1)] + [(column, -1) for column in range(2, last + 1)]
    for column, inwards in columns:
        # Outside on this side, where the key next to it is one or has been made one.
        side = slice(None, column + 1) if inwards > 0 else slice(column, None)
        rows = np.flatnonzero(outside[:, side].all(axis=1))
        if len(rows):
            end, before = column + inwards, column + 2 * inwards
            key_times[rows, column] = 2.0 * key_times[rows, end] - key_times[rows, before]
            made = beyond(keys[rows, end], keys[rows, before])
            keys.positions[rows, column], keys.quaternions[rows, column] = made.positions, made.quaternions
            if keys.scales is not None:
                keys.scales[rows, column] = made.scales
    return key_times, keys
