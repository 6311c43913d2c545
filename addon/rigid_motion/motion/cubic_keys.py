"""The keys an animator would set: the fewest cubic curves through samples, found by dynamic programming.

A segment is a cubic Hermite polynomial in time from one sample to another: CUBICSPLINE of glTF, or a Bezier curve of
Blender whose handles are a third of the segment long. Slopes are fitted by least squares, and are the same on both
sides of a key where the tolerance permits. The tolerance holds at the samples.

Quaternions are four numbers. Their length between keys does not matter, because players normalise them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .quaternions import ZERO_ANGLE_RAD, align_signs

CONSTANT_KIND, LINEAR_KIND, CUBIC_KIND = SEGMENT_KINDS = (0, 1, 2)

FIRST_SEGMENT_SAMPLES = 64
"""Longest segment at first, in samples. Neighbouring segments are merged later where one curve suffices for both."""

HOPELESS_ERROR_RATIOS = {False: 2.0, True: 1.2}
"""Longer segments from a sample are not tried after one with this many times the allowed error; for lines if True."""

EXACT_SEGMENT_WORTH_KEYS = 1.0
"""What a segment with the largest allowed error costs more than an exact one, in keys. So keys keep their frames."""

MAX_HELD_CHANGE_RATIO = 1e-3
"""A sample that differs from the one before by less than this fraction of what is allowed holds its value."""

MAX_LINE_ERROR_RATIO = 0.1
"""A segment that is within this fraction of what is allowed of a line counts as one."""

QUATERNION_LENGTH_WEIGHT = 1e-6
"""The weight of a quaternion's length between keys: just enough for there to be one solution."""


SLOPE_DAMPING_WEIGHT = 1e-7
"""Weight, relative to the samples, of keeping slopes equal to the line's, for slopes that the samples leave open."""

JUMP_PRICE_KEYS = 1.5
"""Price in keys of a segment that ends with a jump."""

THIRD_RATIO = 1.0 / 3.0
"""Length of handles, as a fraction of the segment, with which values are cubics in time."""

NEWTON_STEPS = 6
"""Newton steps to full precision, for handles not much longer than that."""

AT_ONCE = 2**15
"""Samples of segments that are processed at a time."""

SLOPE_AGREEMENT_ROUNDS = 4
"""Rounds of trying to make the slopes on both sides of keys the same."""


class CubicKeys(NamedTuple):
    """Keys of one group of channels, and the curves between them."""

    times: np.ndarray
    """Shape (k,), rising, seconds."""

    values: np.ndarray
    """Shape (k, n)."""

    arriving: np.ndarray
    """Slopes per second just before each key, shape (k, n)."""

    leaving: np.ndarray
    """Slopes per second just after each key, shape (k, n)."""

    kinds: np.ndarray
    """CONSTANT_KIND, LINEAR_KIND or CUBIC_KIND for the segment after each key, shape (k,)."""


class Samples(NamedTuple):
    """The values of a group of channels, and how far off curves may be."""

    values: np.ndarray
    """Shape (m, n)."""

    allowed: np.ndarray
    """How far off each sample may be, as the length of the difference of values, shape (m,)."""

    are_turns: bool = False
    """Whether values are quaternions."""

    desired: np.ndarray | None = None
    """What curves should be near, if not `values`, shape (m, n)."""

    handles: float = THIRD_RATIO
    """Length of Bezier handles, 0.3 to 0.5 of the segment: time is then a cubic, too."""

    lengths: float = QUATERNION_LENGTH_WEIGHT
    """Weight of a quaternion's length between keys: with more of it, slopes are no steeper than needed."""


Segments = tuple[np.ndarray, np.ndarray]
"""What the slopes of segments add to lines over their length (k, 2, n), and their errors over what is allowed (k,)."""


def values_at(keys: CubicKeys, times: np.ndarray) -> np.ndarray:
    """Return the values (m, n) at times (m,); before the first key and after the last they are held."""
    times = np.clip(times, keys.times[0], keys.times[-1])
    if len(keys.times) == 1:
        return np.repeat(keys.values, len(times), axis=0)
    segment = np.clip(np.searchsorted(keys.times, times, side="right") - 1, 0, len(keys.times) - 2)
    span = np.diff(keys.times)[segment, None]
    s = (times - keys.times[segment])[:, None] / span
    first, second = keys.values[segment], keys.values[segment + 1]
    line = first + s * (second - first)
    chord = second - first
    before, behind = _bends(s)
    cubic = (
        line + before * (span * keys.leaving[segment] - chord) + behind * (span * keys.arriving[segment + 1] - chord)
    )
    kinds = keys.kinds[segment, None]
    held = np.where(s < 1.0, first, second)
    return np.where(kinds == CUBIC_KIND, cubic, np.where(kinds == LINEAR_KIND, line, held))


def is_of_lines(keys: CubicKeys) -> bool:
    """Return whether no segment is curved."""
    return not np.any(keys.kinds == CUBIC_KIND)


def joined(parts: Sequence[CubicKeys], *, are_turns: bool = False) -> CubicKeys:
    """Return successive curves as one. Each begins with the last key of the one before.

    A quaternion may begin with the opposite sign.
    """
    result = parts[0]
    for part in parts[1:]:
        sign = -1.0 if are_turns and part.values[0] @ result.values[-1] < 0.0 else 1.0
        values, arriving, leaving = (sign * own for own in part[1:4])
        result = CubicKeys(
            np.append(result.times, part.times[1:]),
            np.concatenate((result.values, values[1:])),
            np.concatenate((result.arriving, arriving[1:])),
            np.concatenate((result.leaving[:-1], leaving)),
            np.append(result.kinds[:-1], part.kinds),
        )
    return result


def fitted(
    times: np.ndarray,
    values: np.ndarray,
    allowed: np.ndarray | float,
    *,
    are_turns: bool = False,
    steps: bool = False,
    lines: bool = False,
) -> CubicKeys:
    """Return the fewest keys whose curves are within the tolerance at all samples.

    Parameters
    ----------
    times : array, shape (m,)
        Rising, seconds.
    values : array, shape (m, n)
        Keys have these values.
    allowed : array, shape (m,), or float
        How far off values may be at each sample, above zero: the length of the difference. For quaternions this is half
        of the angle in radians.
    are_turns : bool, optional
        Whether values are unit quaternions.
    steps : bool, optional
        Whether a value may stay until the next key and jump there.
    lines : bool, optional
        Whether all segments must be lines.

    Returns
    -------
    CubicKeys
    """
    return fitted_together(times, [Samples(values, np.asarray(allowed), are_turns)], steps=steps, lines=lines)[0]


def fitted_together(
    times: np.ndarray, groups: Sequence[Samples], *, steps: bool = False, lines: bool = False
) -> list[CubicKeys]:
    """Return the fewest keys for several groups of channels with keys at the same times: see `fitted`.

    The list is empty if there are no such keys, which can happen when desired values differ from the values.
    """
    fits = [_Fit(times, samples, lines=lines) for samples in groups]
    keys = _joined(fits, _fewest(fits, steps=steps))
    return [fit.keys_at(keys, steps=steps) for fit in fits] if len(keys) else []


def keyed_at(times: np.ndarray, samples: Samples, keys: np.ndarray, *, steps: bool = False) -> CubicKeys:
    """Return curves with keys at these samples (k,), with slopes by least squares."""
    return _Fit(times, samples).keys_at(keys, steps=steps)


def errors_between(times: np.ndarray, samples: Samples, keys: np.ndarray) -> np.ndarray:
    """Return the largest errors, over what is allowed, of curves between successive samples of these (k,): (k - 1,)."""
    return _Fit(times, samples).between(keys[:-1], keys[1:])[1]


def _bends(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what slopes at both ends add to a line at the fractions s of a segment."""
    return s * (1.0 - s) ** 2, s**2 * (s - 1.0)


def _parameters(s: np.ndarray, handles: float) -> np.ndarray:
    """Return the parameters of Bezier curves at fractions s of their time, with handles of this length."""
    if handles == THIRD_RATIO:
        return s
    result = s
    for _ in range(NEWTON_STEPS):
        off = (((6.0 * handles - 2.0) * result + 3.0 - 9.0 * handles) * result + 3.0 * handles) * result - s
        slope = ((18.0 * handles - 6.0) * result + 6.0 - 18.0 * handles) * result + 3.0 * handles
        result = result - off / slope
    return result


class _Fit:
    """Curves through the samples of a group of channels."""

    def __init__(self, times: np.ndarray, samples: Samples, *, lines: bool = False) -> None:
        self.times, self.is_turned, self.lines = times, samples.are_turns, lines
        self.handles, self.lengths = samples.handles, samples.lengths
        self.values = align_signs(samples.values) if samples.are_turns else samples.values
        self.desired = self.values
        if samples.desired is not None:
            self.desired = samples.desired
            if samples.are_turns:
                opposite = np.einsum("mi,mi->m", self.desired, self.values) < 0.0
                self.desired = np.where(opposite[:, None], -self.desired, self.desired)
        self.allowed = np.broadcast_to(np.asarray(samples.allowed, dtype=np.float64), times.shape)
        self.weights = self.allowed**-2.0
        self.outer = (self.values[:, :, None] * self.values[:, None, :]).reshape(len(times), -1)

    def still(self) -> np.ndarray:
        """Return for each sample but the last (m - 1,) whether the next one holds its value."""
        least = MAX_HELD_CHANGE_RATIO * np.minimum(self.allowed[1:], self.allowed[:-1])
        return np.linalg.norm(np.diff(self.values, axis=0), axis=1) <= least

    def is_held(self, first: int, end: int) -> bool:
        """Return whether a sample's value holds up to another sample."""
        some = slice(first, end + 1)
        changes = np.linalg.norm(self.values[some] - self.values[first], axis=1) / self.allowed[some]
        return changes.max() <= MAX_LINE_ERROR_RATIO and self.off_line(first, end) <= 1.0 - MAX_LINE_ERROR_RATIO

    def off_line(self, first: int, end: int) -> float:
        """Return the largest error, over what is allowed, of the line between two samples."""
        nothing = np.zeros((1, 2, self.values.shape[1]))
        return float(self.segments(np.array([first]), end - first, nothing)[1][0])

    def errors(self, is_key: np.ndarray) -> np.ndarray:
        """Return the largest errors, over what is allowed, by the first sample of a segment and its length minus one.

        Shape (m, FIRST_SEGMENT_SAMPLES); infinite where not known.
        """
        count = len(self.times)
        result = np.full((count, FIRST_SEGMENT_SAMPLES), np.inf, dtype=np.float32)
        alive = np.flatnonzero(is_key[:-1])
        for length in range(1, min(FIRST_SEGMENT_SAMPLES, count - 1) + 1):
            alive = alive[alive + length < count]
            if not len(alive):
                break
            errors = self.segments(alive, length)[1]
            result[alive, length - 1] = errors
            alive = alive[errors <= HOPELESS_ERROR_RATIOS[self.lines]]
        return result

    def between(self, firsts: np.ndarray, ends: np.ndarray) -> Segments:
        """Return what slopes of segments add to lines (k, 2, n), over the whole length, and their errors (k,)."""
        bends, errors = np.zeros((len(firsts), 2, self.values.shape[1])), np.zeros(len(firsts))
        for length in np.unique(ends - firsts).tolist():
            some = ends - firsts == length
            bends[some], errors[some] = self.segments(firsts[some], length)
        return bends, errors

    def segments(self, firsts: np.ndarray, length: int, given: np.ndarray | None = None) -> Segments:
        """Return `between` for segments of one length, with slopes by least squares unless given."""
        step = max(1, AT_ONCE // (length + 1))
        bends, errors = np.zeros((len(firsts), 2, self.values.shape[1])), np.zeros(len(firsts))
        for first in range(0, len(firsts), step):
            some = slice(first, first + step)
            bends[some], errors[some] = self._segments(firsts[some], length, None if given is None else given[some])
        return bends, errors

    def _segments(self, firsts: np.ndarray, length: int, given: np.ndarray | None) -> Segments:
        rows = firsts[:, None] + np.arange(length + 1)
        times, own = self.times[rows], self.values[rows]
        s = ((times - times[:, :1]) / (times[:, -1:] - times[:, :1]))[..., None]
        shown = self._line(s, own[:, :1], own[:, -1:])
        if self.lines or (length == 1 and given is None):
            bends = np.zeros((len(firsts), 2, own.shape[2]))
        else:
            basis = np.concatenate(_bends(_parameters(s, self.handles)), axis=2)
            bends = self._fitted_bends(rows, basis, own, own - shown) if given is None else given
            shown += basis @ bends
        desired = own if self.desired is self.values else self.desired[rows]
        if self.is_turned:
            # The length of the difference of unit vectors.
            cosines = np.einsum("kmi,kmi->km", shown, desired) / np.sqrt(np.einsum("kmi,kmi->km", shown, shown))
            squares = np.maximum(2.0 - 2.0 * cosines, 0.0)
        else:
            shown -= desired
            squares = np.einsum("kmi,kmi->km", shown, shown)
        return bends, np.sqrt((squares * self.weights[rows]).max(axis=1))

    def _line(self, s: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Return values at fractions s of the way between two values; rotations stored as lines turn at a constant
        rate.
        """
        if not (self.lines and self.is_turned):
            return first + s * (last - first)
        angle = 2.0 * np.arctan2(np.linalg.norm(last - first, axis=-1), np.linalg.norm(last + first, axis=-1))
        angle = np.maximum(angle, ZERO_ANGLE_RAD)[..., None]
        return (np.sin((1.0 - s) * angle) * first + np.sin(s * angle) * last) / np.sin(angle)

    def _fitted_bends(self, rows: np.ndarray, basis: np.ndarray, own: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """Return what slopes add to lines by least squares, (k, 2, n), given what lines miss."""
        count, _, width = own.shape
        weights = self.weights[rows]
        weighted = np.swapaxes(basis * (weights / weights.max(axis=1, keepdims=True))[..., None], 1, 2)
        if not self.is_turned:
            return np.linalg.solve(weighted @ basis + SLOPE_DAMPING_WEIGHT * np.eye(2), weighted @ rest)
        rest -= ((1.0 - self.lengths) * np.einsum("kmi,kmi->km", own, rest))[..., None] * own
        pairs = weighted[:, (0, 0, 1)] * np.swapaxes(basis, 1, 2)[:, (0, 1, 1)]
        radial = (pairs @ self.outer[rows]).reshape(count, 3, width, width)
        blocks = pairs.sum(axis=2)[..., None, None] * np.eye(width) - (1.0 - self.lengths) * radial
        normal = np.empty((count, 2, width, 2, width))
        normal[:, 0, :, 0], normal[:, 1, :, 1] = blocks[:, 0], blocks[:, 2]
        normal[:, 0, :, 1] = normal[:, 1, :, 0] = blocks[:, 1]
        normal = normal.reshape(count, 2 * width, 2 * width) + SLOPE_DAMPING_WEIGHT * np.eye(2 * width)
        right = (weighted @ rest).reshape(count, 2 * width, 1)
        return np.linalg.solve(normal, right).reshape(count, 2, width)

    def keys_at(self, keys: np.ndarray, *, steps: bool) -> CubicKeys:
        """Return curves with keys at these samples (k,)."""
        firsts, ends = keys[:-1], keys[1:]
        bends, errors = self.between(firsts, ends)
        kinds = np.full(len(keys), CONSTANT_KIND)
        kinds[:-1] = self._kinds(firsts, ends, errors, steps=steps)
        bends[kinds[:-1] != CUBIC_KIND] = 0.0
        spans = np.diff(self.times[keys])[:, None]
        chords = np.diff(self.values[keys], axis=0)
        slopes = (chords[:, None] + bends * (THIRD_RATIO / self.handles)) / spans[:, None]
        slopes[kinds[:-1] == CONSTANT_KIND] = 0.0
        slopes = self._with_shared_slopes(keys, slopes, kinds)
        nothing = np.zeros((1, self.values.shape[1]))
        arriving, leaving = np.concatenate((nothing, slopes[:, 1])), np.concatenate((slopes[:, 0], nothing))
        return CubicKeys(self.times[keys], self.values[keys], arriving, leaving, kinds)

    def _kinds(self, firsts: np.ndarray, ends: np.ndarray, errors: np.ndarray, *, steps: bool) -> np.ndarray:
        """Return the kinds of segments (k,), given their errors as curves."""
        still = np.append(0, np.cumsum(self.still()))
        held = still[ends] - still[firsts] == ends - firsts
        stepped = steps & (ends > firsts + 1) & (still[ends - 1] - still[firsts] == ends - 1 - firsts)
        lines = np.array([self.off_line(first, end) for first, end in zip(firsts.tolist(), ends.tolist(), strict=True)])
        return np.where(
            held | stepped,
            CONSTANT_KIND,
            np.where(lines <= np.maximum(errors, MAX_LINE_ERROR_RATIO), LINEAR_KIND, CUBIC_KIND),
        )

    def _with_shared_slopes(self, keys: np.ndarray, slopes: np.ndarray, kinds: np.ndarray) -> np.ndarray:
        """Return slopes (k - 1, 2, n) of segments, made the same on both sides of a key where the tolerance permits."""
        curved = kinds[:-1] == CUBIC_KIND
        tried = curved[:-1] & curved[1:]
        spans, weights = np.diff(self.times[keys])[:, None], np.diff(self.times[keys])[:, None] ** 3
        shared = (weights[:-1] * slopes[:-1, 1] + weights[1:] * slopes[1:, 0]) / (weights[:-1] + weights[1:])
        chords = np.diff(self.values[keys], axis=0)
        for _ in range(SLOPE_AGREEMENT_ROUNDS):
            result = slopes.copy()
            result[:-1, 1][tried], result[1:, 0][tried] = shared[tried], shared[tried]
            bends = (spans[:, None] * result - chords[:, None]) * (self.handles / THIRD_RATIO)
            wrong = np.zeros(len(slopes), dtype=bool)
            for length in np.unique(np.diff(keys)[curved]).tolist():
                some = np.flatnonzero(curved & (np.diff(keys) == length))
                wrong[some] = self.segments(keys[some], length, bends[some])[1] > 1.0
            if not (tried & (wrong[:-1] | wrong[1:])).any():
                return result
            tried = tried & ~(wrong[:-1] | wrong[1:])
        return slopes


def _fewest(fits: Sequence[_Fit], *, steps: bool) -> np.ndarray:
    """Return the fewest samples, rising, with all segments between them within the tolerance; if equal, the nearest."""
    count = len(fits[0].times)
    still = np.stack([fit.still() for fit in fits]).all(axis=0)
    begins = np.flatnonzero(still & ~np.append(False, still[:-1]))
    ends = np.flatnonzero(still & ~np.append(still[1:], False)) + 1
    is_key, hold = np.ones(count, dtype=bool), np.full(count, -1)
    for first, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if all(fit.is_held(first, end) for fit in fits):
            is_key[first + 1 : end], hold[first] = False, end
    errors = np.stack([fit.errors(is_key) for fit in fits]).max(axis=0)
    price = np.where(errors <= 1.0, 1.0 + EXACT_SEGMENT_WORTH_KEYS * errors.astype(np.float64) ** 2, np.inf)
    best = np.full(count + FIRST_SEGMENT_SAMPLES, np.inf)
    best[count - 1], following = 0.0, np.zeros(count, dtype=np.int64)
    best[:count][~is_key] = np.inf
    for sample in range(count - 2, -1, -1):
        if not is_key[sample]:
            continue
        costs = price[sample] + best[sample + 1 : sample + 1 + FIRST_SEGMENT_SAMPLES]
        nearest = int(np.argmin(costs))
        best[sample], following[sample] = costs[nearest], sample + 1 + nearest
        if hold[sample] >= 0:
            # A step ends at the sample with another value, and is used only where that saves a key.
            prices = ((hold[sample], 1.0), (hold[sample] + 1, JUMP_PRICE_KEYS))[
                : 2 if steps and hold[sample] + 1 < count else 1
            ]
            for end, cost in prices:
                if cost + best[end] < best[sample]:
                    best[sample], following[sample] = cost + best[end], end
    if not np.isfinite(best[0]):
        return np.empty(0, dtype=np.int64)
    keys = [0]
    while keys[-1] < count - 1:
        keys.append(int(following[keys[-1]]))
    return np.array(keys)


def _joined(fits: Sequence[_Fit], keys: np.ndarray) -> np.ndarray:
    """Return the keys without those between two segments that one curve, longer than was tried so far, can replace."""
    while True:
        tried = np.flatnonzero(keys[2:] - keys[:-2] > FIRST_SEGMENT_SAMPLES)
        if not len(tried):
            return keys
        errors = np.max([fit.between(keys[tried], keys[tried + 2])[1] for fit in fits], axis=0)
        removed: list[int] = []
        for place in tried[errors <= 1.0].tolist():
            if not removed or place + 1 > removed[-1] + 1:
                removed.append(place + 1)
        if not removed:
            return keys
        keys = np.delete(keys, removed)
