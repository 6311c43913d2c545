"""Keys of one track in few bits: fitted to the motion between keys as well, rounded, and repaired where needed.

Where rounding or the fit displaces a track too far at a few samples, nearby keys are rounded differently.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..motion.quaternions import normalise, turned_at
from .attribute_streams import likely_size
from .filters import MAX_INT16, MAX_SMALL_COMPONENT, MOST_BITS, floats_of, quaternions_of, with_floats, with_quaternions
from .tracks import TO_WXYZ, TO_XYZW

MAX_MENDED_RATIO = 0.05
"""Largest fraction of samples that may be too far off and still be repaired."""

MAX_REFITS, FAR_SAMPLE_WEIGHT, FAR_ERROR_RATIO = 3, 4.0, 0.8
"""Most refits of keys, and the weight factor for samples whose error is above this fraction of the limit."""

MENDING_ROUNDS, MAX_FAR_RATIO, MAX_FAR_ERROR_RATIO = 3, 0.01, 1.6
"""Rounds of repair, the largest fraction of samples that may be too far off, and their largest error ratio."""

FIT_SWEEPS, KEY_SAMPLE_WEIGHT = 12, 0.02
"""Relaxation sweeps of a fit, and the weight that draws a key to the motion at the key itself."""

WHOLE_BITS = range(4, MOST_BITS + 1)

GRID_EXPONENTS = range(2, -21, -1)

ROUNDING_MOVES = [(column, step) for column in range(3) for step in (-1, 1)]

SHARED_TIMES, OWN_TIMES, SINGLE_KEY = "shared", "own", "single"

Measure = Callable[[np.ndarray, np.ndarray | slice], np.ndarray]
"""Function of the values at some samples (k, width) and the indices of those samples: returns errors, shape (k,)."""

ALL_SAMPLES = slice(None)


class PackedKeys(NamedTuple):
    """Keys of a track as stored, with their size and the motion they give."""

    times: np.ndarray
    """Shape (n,)."""

    stored: np.ndarray
    """Rotations as x, y, z, w, (n, 4), or translations as floats, (n, 3)."""

    shown: np.ndarray
    """Values at the samples, (m, 4) or (m, 3)."""

    size: float
    """About how many bytes the values take."""

    kind: str
    """SHARED_TIMES with other tracks, OWN_TIMES or SINGLE_KEY."""


def fitted(times: np.ndarray, samples: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return key values at times (k,) whose lines fit values (m, width) at samples (m,), by weighted least squares."""
    if len(times) == 1:
        return values.mean(axis=0)[None]
    count = len(times)
    segments = np.clip(np.searchsorted(times, samples, side="right") - 1, 0, count - 2)
    second = np.clip((samples - times[segments]) / np.diff(times)[segments], 0.0, 1.0)
    first = 1.0 - second

    def summed(before: np.ndarray, behind: np.ndarray) -> np.ndarray:
        return np.bincount(segments, weights * before, count) + np.bincount(segments + 1, weights * behind, count)

    middle, beside = summed(first**2, second**2), np.bincount(segments, weights * first * second, count)[:-1, None]
    result = np.stack([np.interp(times, samples, column) for column in values.T], axis=1)
    drawn = KEY_SAMPLE_WEIGHT * middle.mean()
    right = np.stack([summed(first * column, second * column) for column in values.T], axis=1) + drawn * result
    for sweep in range(2 * FIT_SWEEPS):
        rest = right.copy()
        rest[1:] -= beside * result[:-1]
        rest[:-1] -= beside * result[1:]
        result[sweep % 2 :: 2] = (rest / (middle + drawn)[:, None])[sweep % 2 :: 2]
    return result


@dataclass(eq=False)
class Aim:
    """The motion that a track should have.

    Parameters
    ----------
    samples : array, shape (m,)
    values : array, shape (m, width)
    reach : float
        Largest error for a difference of 1 in the values.
    measure : Measure
        Returns 1 for the allowed error.
    turns : bool
        Whether the values are quaternions.
    """

    samples: np.ndarray
    values: np.ndarray
    reach: float
    measure: Measure
    turns: bool

    def __post_init__(self) -> None:
        self._fits: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def between(self, keys: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the interpolated values of keys at times (k,), shape (k, width)."""
        if len(keys) == 1:
            return np.repeat(values, len(times), axis=0)
        if self.turns:
            return turned_at(keys, values, np.clip(times, keys[0], keys[-1]))
        return np.stack([np.interp(times, keys, column) for column in values.T], axis=1)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the desired values at times (k,), shape (k, width)."""
        return self.between(self.samples, self.values, times)

    def fit(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the best key values at these times, and their errors at the samples before rounding."""
        known = times.tobytes()
        if known not in self._fits:
            weights = np.ones(len(self.samples))
            for _ in range(MAX_REFITS):
                values = fitted(times, self.samples, self.values, weights)
                values = normalise(values) if self.turns else values
                off = self.measure(self.between(times, values, self.samples), ALL_SAMPLES)
                near = off > FAR_ERROR_RATIO
                if len(times) == 1 or not near.any() or near.mean() > MAX_MENDED_RATIO:
                    break
                weights[near] *= FAR_SAMPLE_WEIGHT
            self._fits[known] = values, off
        return self._fits[known]

    def failing(self, times: np.ndarray) -> float:
        """Return the fraction of samples with too large an error, for keys at these times."""
        return float((self.fit(times)[1] > 1.0).mean())

    def keys(self, times: np.ndarray, kind: str) -> PackedKeys | None:
        """Return keys at these times, in the fewest bits within the allowed error; None if impossible."""
        values, off = self.fit(times)
        if (off > 1.0).mean() > MAX_MENDED_RATIO:
            return None
        choices = WHOLE_BITS if self.turns else GRID_EXPONENTS
        room = max(1.0 - float(np.quantile(off, 0.9)), 0.1)
        likely = next((n for n, bits in enumerate(choices) if self._rounding(bits) <= room), len(choices) - 1)
        fewer = True
        result = None
        while likely < len(choices) and (result := self._rounded(times, values, choices[likely], kind)) is None:
            likely += 1
            fewer = False
        while fewer and likely and (found := self._rounded(times, values, choices[likely - 1], kind)) is not None:
            result, likely = found, likely - 1
        return result

    def _rounding(self, bits: int) -> float:
        """Return about how large the error from rounding is."""
        return self.reach * (0.7 * MAX_SMALL_COMPONENT / (2 ** (bits - 1) - 1) if self.turns else 0.4 * 2.0**bits)

    def _rounded(self, times: np.ndarray, values: np.ndarray, bits: int, kind: str) -> PackedKeys | None:
        elements = with_quaternions(values[:, TO_XYZW], bits) if self.turns else with_floats(values, bits)
        shown = self.between(times, self._played(elements), self.samples)
        if (mended := self._repaired(times, elements, shown, bits)) is None:
            return None
        elements = mended
        stored = quaternions_of(elements) if self.turns else floats_of(elements)
        return PackedKeys(times, stored, shown, likely_size(elements), kind)

    def _played(self, elements: np.ndarray) -> np.ndarray:
        if self.turns:
            return (quaternions_of(elements) / MAX_INT16)[:, TO_WXYZ]
        return floats_of(elements).astype(np.float64)

    def _shifted(
        self, elements: np.ndarray, bits: int, keys: np.ndarray, columns: np.ndarray | int, steps: np.ndarray | int
    ) -> np.ndarray:
        """Return the elements with `columns` of some keys moved by `steps`, in units of the smallest increment."""
        if self.turns:
            parts = elements.view("<i2").copy()
            largest = parts[keys, 3] | 3
            parts[keys, columns] = np.clip(parts[keys, columns] + steps, -largest, largest)
            return parts.view(np.uint8)
        numbers = floats_of(elements).astype(np.float64)
        numbers[keys, columns] += np.ldexp(steps, bits)
        return with_floats(numbers, bits)

    def _repaired(self, times: np.ndarray, elements: np.ndarray, shown: np.ndarray, bits: int) -> np.ndarray | None:
        """Return the elements with keys adjusted near samples with too large errors; None if some errors remain."""
        off, count = self.measure(shown, ALL_SAMPLES), len(times)
        if count < 3 or off.max() > MAX_FAR_ERROR_RATIO or (off > 1.0).mean() > MAX_FAR_RATIO:
            return elements if off.max() <= 1.0 else None
        segments = np.clip(np.searchsorted(times, self.samples, side="right") - 1, 0, count - 2)
        for turn in range(MENDING_ROUNDS):
            if off.max() <= 1.0:
                return elements
            worst = np.zeros(count + 2)
            np.maximum.at(worst, segments + 1, off)
            np.maximum.at(worst, segments + 2, off)
            left, right = (worst[:-2], worst[2:])[:: 1 if turn % 2 else -1]
            own = worst[1:-1]
            chosen = np.flatnonzero((own > 1.0) & (own >= left) & (own > right))
            near = np.zeros(count + 1, dtype=np.int64)
            near[chosen] = near[chosen + 1] = np.arange(1, len(chosen) + 1)
            (some,) = np.nonzero(near[segments + 1])
            owner = near[segments + 1][some] - 1
            best, least = np.full(len(chosen), -1), own[chosen]
            for number, (column, step) in enumerate(ROUNDING_MOVES):
                played = self._played(self._shifted(elements, bits, chosen, column, step))
                after = np.zeros(len(chosen))
                np.maximum.at(after, owner, self.measure(self.between(times, played, self.samples[some]), some))
                best[after < least], least = number, np.minimum(after, least)
            better = best >= 0
            if not better.any():
                return None
            columns, steps = np.array(ROUNDING_MOVES)[best[better]].T
            elements = self._shifted(elements, bits, chosen[better], columns, steps)
            shown[:] = self.between(times, self._played(elements), self.samples)
            off = self.measure(shown, ALL_SAMPLES)
        return elements if off.max() <= 1.0 else None

    def finest(self, times: np.ndarray) -> PackedKeys:
        """Return keys at these times, with the most bits possible."""
        measure, self.measure = self.measure, lambda shown, _: np.zeros(len(shown))
        result = self._rounded(
            times, self.fit(times)[0], (WHOLE_BITS if self.turns else GRID_EXPONENTS)[-1], SHARED_TIMES
        )
        self.measure = measure
        assert result is not None
        return result
