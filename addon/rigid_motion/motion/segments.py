"""Segments: the quantities between two successive keys that do not depend on time, computed once.

Both keys of a segment are described relative to the pose half-way, with s = 2 u - 1 from -1 to 1 instead of u from 0 to
1. The sum and the difference of the quaternions q0 and q1 at the two keys are orthogonal. With their directions m and d
and with h, a quarter of the angle turned, the rotation in every mode is

    q = m cos(psi) + d sin(psi),        psi = s h (slerp)  or  tan(psi) = s tan(h) (normalised lerp),

the axis of the turn is n = d m*, and every position is a sum of a few fixed vectors, each times a function of psi and
s. Where a formula divides by an angle that may vanish, the numerator has the sine of the same angle. So there is no
special case for small turns, and none at 180 degrees.

The fast implementation of a mode is a function from `Segments` to `Curves`, in `rigid_motion.motion.curves`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import series, twists
from .piecewise import BLOCK_SAMPLES, DENSE_RUN_SAMPLES, blocks, combine, is_dense, multiply_matrices
from .poses import Poses, aligned, of_rows, reshaped
from .quaternions import components, cross, multiply, rotate

MAX_SAME_POSE_CHANGE = 1e-6
"""The largest change between two keys that count as the same pose: in units of length, in radians, and in the logarithm
of scale. The same pose computed twice in single precision differs slightly."""

MAX_PIECE_TURN_RAD = 1.5
"""The largest turn in radians of a piece of a bent curve that a power series reproduces except for rounding."""

POSE_ROWS = 8
"""Rows for position, quaternion and scale. Used even without scale, as matrices of eight rows multiply faster."""

MAX_NARROW_S = 4.0 / 3.0
"""The largest |s| at which psi, 45 degrees at the keys, is no more than the 60 of `trigonometry.MAX_NARROW_RAD`."""

SMALLEST_ANGLE = 1e-150
"""Replaces an angle of zero where only ratios of angles count. Its square is still above the smallest float."""

MOST_GROWTH = 50.0
"""The largest logarithm of growth by a bend: after sudden growth, splines overshoot beyond the range of floats."""


Ends = tuple[np.ndarray, np.ndarray]
"""Components at the first and at the second keys of segments."""


@dataclass(frozen=True, eq=False)
class Segments:
    """S segments, one after the other along the last axis of each array.

    They may be a selection of the segments between the keys; arrays of all keys and gaps then include the others.
    """

    start: np.ndarray
    """The time of the first key, shape (S,), seconds."""

    rate: np.ndarray
    """Change of s per second, shape (S,)."""

    centre: np.ndarray
    """The point half-way between the positions, shape (3, S)."""

    chord: np.ndarray
    """The vector from the first position to the second, shape (3, S)."""

    middle: np.ndarray
    """m, the rotation half-way, shape (4, S)."""

    difference: np.ndarray
    """d, the direction from the first quaternion to the second, shape (4, S); zero where they are equal."""

    quarter_angle: np.ndarray
    """h, from 0 to pi / 4, a quarter of the angle between the rotations, shape (S,)."""

    scales: np.ndarray | None
    """The scales at both ends, shape (2, S), or None."""

    keys: Poses
    """All keys of each object, shape (..., n)."""

    positions: Ends
    """Positions at both ends of all segments, shapes (3, ..., n - 1)."""

    quaternions: Ends
    """Quaternions at both ends of all segments, shapes (4, ..., n - 1)."""

    durations: np.ndarray
    """Seconds from each key to the next, shape (..., n - 1), or without the leading axes if objects share times."""

    desired: slice
    """The slice of the n - 1 segments of each object that the S segments are."""

    @classmethod
    def between(cls, key_times: np.ndarray, keys: Poses, desired: slice = slice(None)) -> Segments:
        """Return the desired segments of each object, from times (..., n) and keys (..., n) with aligned signs."""
        rates, scales = 2.0 / (key_times[..., 1:] - key_times[..., :-1]), keys.scales
        positions, quaternions = _ends(keys.positions), _ends(keys.quaternions)
        shape = positions[0][0, ..., desired].shape
        (begin, end), (first, second) = (
            [_flat(rows[..., desired]) for rows in two] for two in (positions, quaternions)
        )
        total, change = first + second, second - first
        total_length, change_length = _length(total), _length(change)
        middle, difference = total / total_length, change / np.maximum(change_length, SMALLEST_ANGLE)
        return cls(
            start=np.broadcast_to(key_times[..., :-1][..., desired], shape).ravel(),
            rate=np.broadcast_to(rates[..., desired], shape).ravel(),
            centre=0.5 * (begin + end),
            chord=end - begin,
            middle=middle,
            difference=difference,
            quarter_angle=np.maximum(np.arctan2(change_length, total_length), SMALLEST_ANGLE),
            scales=None
            if scales is None
            else np.stack((scales[..., :-1][..., desired].ravel(), scales[..., 1:][..., desired].ravel())),
            keys=keys,
            positions=positions,
            quaternions=quaternions,
            durations=2.0 / rates,
            desired=desired,
        )

    @property
    def are_still(self) -> np.ndarray:
        """Whether nothing moves between two keys except for rounding, for all segments, shape (..., n - 1)."""
        still = in_one_place(*self.positions)
        if not still.any():
            return still
        turn, growth = self.screws[:3], self.screws[6]
        return still & (_length(turn) < MAX_SAME_POSE_CHANGE) & (np.abs(growth) < MAX_SAME_POSE_CHANGE)

    @cached_property
    def screws(self) -> np.ndarray:
        """The twists from each key to the next in one unit of time, and the growth of log scale.

        For all segments of each object, shape (7, ..., n - 1).
        """
        (begin, end), (first, second) = ([_flat(rows).T for rows in two] for two in (self.positions, self.quaternions))
        rows = np.zeros((7, *self.positions[0].shape[1:]))
        rows[:6] = twists.between(begin, first, end, second, shortest=False).reshape(6, *rows.shape[1:])
        if self.keys.scales is not None:
            rows[6] = np.log(self.keys.scales[..., 1:] / self.keys.scales[..., :-1])
        return rows

    def decompose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the chord's part along the axis n, its part across, and n x D, each of shape (3, S).

        Without a turn there is no axis: n is zero, and the whole chord is across.
        """
        m, d = self.middle[1:], self.difference[1:]
        n = self.middle[0] * d - self.difference[0] * m - cross(d, m)
        along = n * np.einsum("ks,ks->s", n, self.chord)
        return along, self.chord - along, cross(n, self.chord)


Rows = tuple[np.ndarray, "np.ndarray | None"]
Basis = Callable[[np.ndarray, list[np.ndarray], bool], Rows]


@dataclass(frozen=True, eq=False)
class Curves:
    """A mode's curves in S segments: quaternion = Q b(s) and position = P c(s), with basis functions b and c."""

    quaternions: np.ndarray
    """Q, shape (4, functions in b, S)."""

    positions: np.ndarray
    """P, shape (3, functions in c, S)."""

    parameters: np.ndarray
    """The parameters of b and c in each segment, shape (parameters, S)."""

    basis: Basis
    """Function of s (n,), a list of parameters (n,), and whether |s| <= MAX_NARROW_S. It returns b stacked on c, shape
    (., n), and scales (n,) or None.
    """

    bends: np.ndarray | None = None
    """The twist and the growth of log scale to add at either end, shape (7, 2, S), or None."""

    fades: np.ndarray | None = None
    """The fraction of each segment in which the bend at its beginning dies away, shape (S,); None means all of it."""

    @cached_property
    def matrices(self) -> np.ndarray:
        """P and Q of each segment as one matrix, shape (S, POSE_ROWS, functions in b and c)."""
        turning, (_, moving, segments) = self.quaternions.shape[1], self.positions.shape
        matrices = np.zeros((segments, POSE_ROWS, turning + moving))
        matrices[:, :3, turning:] = self.positions.transpose(2, 0, 1)
        matrices[:, 3:7, :turning] = self.quaternions.transpose(2, 0, 1)
        return matrices


def interpolate_along(
    curves: Callable[[Segments], Curves], key_times: np.ndarray, keys: Poses, times: np.ndarray, extrapolate: bool
) -> Poses:
    """Return poses (..., m) between at least two keys (..., n), at rising times (..., m).

    `key_times` and `times` may lack the leading axes if all objects share them. Quaternions of keys are unit.
    """
    shape = keys.shape[:-1] + times.shape[-1:]
    keys = reshaped(keys, -1, keys.shape[-1])
    key_times, times = (np.atleast_2d(rows).reshape(-1, rows.shape[-1]) for rows in (key_times, times))
    result = np.empty((POSE_ROWS, len(keys), times.shape[-1]))
    batch_size = max(1, BLOCK_SAMPLES // (key_times.shape[-1] + times.shape[-1]))
    for first in range(0, len(keys), batch_size):
        batch = slice(first, first + batch_size)
        batch_key_times, batch_times = (rows if len(rows) == 1 else rows[batch] for rows in (key_times, times))
        _fill(curves, batch_key_times, keys[batch], batch_times, extrapolate, result[:, batch])
    return reshaped(_poses(result, keys), *shape)


def _poses(rows: np.ndarray, keys: Poses) -> Poses:
    """Return the poses (...) from rows (POSE_ROWS, ...), with scales if the keys have them."""
    return of_rows(rows if keys.scales is not None else rows[:7])


def _fill(
    curves: Callable[[Segments], Curves],
    key_times: np.ndarray,
    keys: Poses,
    times: np.ndarray,
    extrapolate: bool,
    out: np.ndarray,
) -> None:
    """Fill `out` (POSE_ROWS, objects, m) with positions, quaternions and, if the keys have them, scales.

    Key times are (objects or 1, n), keys (objects, n), times (objects or 1, m).
    """
    segments = Segments.between(key_times, aligned(keys))
    samples = np.broadcast_to(times, out.shape[1:]).ravel()
    outside = bool(np.any(times[:, :1] < key_times[:, :1]) or np.any(times[:, -1:] > key_times[:, -1:]))

    def local_time(sample: slice, start: np.ndarray, rate: np.ndarray) -> np.ndarray:
        s = samples[sample] - start
        s *= rate
        s -= 1.0
        if outside and not extrapolate:
            np.clip(s, -1.0, 1.0, out=s)
        return s

    mode, reach = curves(segments), np.inf if outside and extrapolate else 1.0
    fill, numbers = _filler(mode, reach), np.stack((segments.start, segments.rate))
    pieces = _piece_count(segments, mode.bends) if mode.bends is not None and mode.fades is None and reach <= 1.0 else 0
    if 0 < DENSE_RUN_SAMPLES * pieces * segments.start.size <= samples.size:
        coefficients = _series(mode, pieces)
        key_times = _divided_key_times(key_times, pieces)
        start = np.broadcast_to(key_times[:, :-1], (len(keys), key_times.shape[-1] - 1)).ravel()
        numbers = np.stack((start, pieces * segments.rate.repeat(pieces)))

        def fill(piece: slice, s: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
            multiply_matrices(coefficients[piece], series.powers(s), counts, out)

    _evaluate(fill, numbers, _sample_bounds(key_times, times, len(keys)), local_time, out.reshape(POSE_ROWS, -1))


Within = Callable[[np.ndarray, np.ndarray, slice], Poses]
"""Function of pose counts (s,), the progress of each pose (m,) and a slice of s segments that returns poses (m,)."""


def prepare_within(
    curves: Callable[[Segments], Curves],
    key_times: np.ndarray,
    keys: Poses,
    desired: slice = slice(None),
    *,
    is_aligned: bool = False,
) -> Within:
    """Return a function that computes poses between keys from the pose count of each segment and their progress.

    `key_times` and keys are (..., n), at least two in each row and with unit quaternions. The function numbers the
    `desired` segments of all rows one after the other. Progress is 0 at a segment's first key and 1 at its second, and
    may go beyond both. With `is_aligned`, the signs of the quaternions define which way a segment turns, which matters
    at half a turn.
    """
    segments = Segments.between(key_times, keys if is_aligned else aligned(keys), desired)
    mode, no_numbers = curves(segments), np.empty((0, segments.start.size))

    def within(counts: np.ndarray, progress: np.ndarray, selected: slice) -> Poses:
        out = np.empty((POSE_ROWS, progress.size))
        reach = float(max(2.0 * progress.max() - 1.0, 1.0 - 2.0 * progress.min())) if progress.size else 0.0
        fill, first = _filler(mode, reach), selected.start or 0

        def fill_selected(segment: slice, *others: np.ndarray) -> None:
            fill(slice(first + segment.start, first + segment.stop), *others)

        bounds = np.concatenate(((0,), np.cumsum(counts)))
        _evaluate(fill_selected, no_numbers[:, selected], bounds, lambda sample: 2.0 * progress[sample] - 1.0, out)
        return _poses(out, keys)

    return within


Fill = Callable[[slice, np.ndarray, np.ndarray, np.ndarray], None]
"""Function of a slice of segments, s (n,), counts and `out` that fills `out` (POSE_ROWS, n).

The i-th segment of the slice has counts[i] of the values in s.
"""


def _evaluate(
    fill: Fill,
    numbers: np.ndarray,
    bounds: np.ndarray,
    local_time: Callable[..., np.ndarray],
    out: np.ndarray,
) -> None:
    """Fill `out` (POSE_ROWS, m) with the poses of S segments at the samples between their bounds (S + 1,), in blocks.

    `local_time` returns s for a slice of samples, from the rows of `numbers` (., S) repeated for each sample.
    """
    all_counts = np.diff(bounds)
    for segment, sample in blocks(bounds, BLOCK_SAMPLES if is_dense(all_counts) else BLOCK_SAMPLES // 2):
        counts = all_counts[segment]
        fill(segment, local_time(sample, *np.repeat(numbers[:, segment], counts, axis=1)), counts, out[:, sample])


def _filler(mode: Curves, reach: float) -> Fill:
    """Return a function that evaluates a mode's curves at every sample, if no |s| is larger than `reach`."""

    def fill(segment: slice, s: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
        parameters = np.repeat(mode.parameters[:, segment], counts, axis=1)
        basis, scales = mode.basis(s, [*parameters], reach <= MAX_NARROW_S)
        _combine(mode, segment, basis, counts, out)
        if scales is not None:
            out[7] = scales
        if mode.bends is not None:
            fades = None if mode.fades is None else np.repeat(mode.fades[segment], counts)
            _bend(mode.bends[..., segment], fades, s, reach <= 1.0, counts, out)

    return fill


def _piece_count(segments: Segments, bends: np.ndarray) -> int:
    """Return the number of pieces into which each segment must be cut for power series."""
    rates = np.concatenate((segments.screws.reshape(7, 1, -1), bends), axis=1)
    turns = np.sqrt(np.einsum("kbs,kbs->bs", rates[:3], rates[:3])) + np.abs(rates[6])
    return max(1, math.ceil((turns[0] + turns[1:].max(axis=0)).max() / MAX_PIECE_TURN_RAD))


def _series(mode: Curves, pieces: int) -> np.ndarray:
    """Return power series of every segment's curve in pieces, shape (segments * pieces, POSE_ROWS, terms)."""
    count = mode.parameters.shape[1]
    moments = series.moments(pieces)
    values = np.zeros((POSE_ROWS, count * moments.size))
    bounds = moments.size * np.arange(count + 1)
    _evaluate(
        _filler(mode, 1.0),
        np.empty((0, count)),
        bounds,
        lambda sample: np.resize(moments, sample.stop - sample.start),
        values,
    )
    return series.fit(values)


def _divided_key_times(key_times: np.ndarray, pieces: int) -> np.ndarray:
    """Return key times (k, n) with each segment divided into equal pieces, shape (k, (n - 1) * pieces + 1)."""
    starts = key_times[:, :-1, None] + np.diff(key_times)[..., None] * (np.arange(pieces) / pieces)
    return np.append(starts.reshape(len(key_times), -1), key_times[:, -1:], axis=1)


def _sample_bounds(key_times: np.ndarray, times: np.ndarray, objects: int) -> np.ndarray:
    """Return the first sample of each segment among the samples of all objects, and their number, shape (S + 1,)."""
    starts = np.zeros((objects, key_times.shape[-1] - 1), dtype=np.int64)
    inner_keys = key_times[:, 1:-1]
    if inner_keys.size:
        # One search if all objects share their times, else one for each.
        for row in range(max(len(inner_keys), len(times))):
            result = np.searchsorted(times[row % len(times)], inner_keys[row % len(inner_keys)], side="right")
            starts[row if len(inner_keys) > 1 or len(times) > 1 else slice(None), 1:] = result
    starts += times.shape[-1] * np.arange(objects)[:, None]
    return np.append(starts.ravel(), objects * times.shape[-1])


def _combine(mode: Curves, segment: slice, basis: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` (POSE_ROWS, n) with positions and quaternions: each segment's coefficients times the basis (., n).

    The i-th segment has counts[i] samples, and at least one segment has samples.
    """
    if not is_dense(counts):
        positions, quaternions = mode.positions[..., segment], mode.quaternions[..., segment]
        turning = mode.quaternions.shape[1]
        np.einsum("kbn,bn->kn", np.repeat(positions, counts, axis=2), basis[turning:], out=out[:3])
        np.einsum("kbn,bn->kn", np.repeat(quaternions, counts, axis=2), basis[:turning], out=out[3:7])
        return
    multiply_matrices(mode.matrices[segment], basis, counts, out)


def _bend(
    bends: np.ndarray, fades: np.ndarray | None, s: np.ndarray, within: bool, counts: np.ndarray, out: np.ndarray
) -> None:
    """Bend poses (POSE_ROWS, n) between keys: add twists `bends` (7, 2, S) where each segment leaves and arrives.

    Poses at the keys stay the same. Beyond the keys the bend continues with its twist there. `fades` (n,) is, for each
    sample, the fraction of its segment in which the first bend dies away.
    """
    u, left = 0.5 + 0.5 * s, 0.5 - 0.5 * s
    faded = left if fades is None else 1.0 - np.minimum(u / fades, 1.0)
    functions = np.stack((u * faded * faded, -u * u * left))
    if not within:
        functions = np.where(u < 0.0, ((1.0,), (0.0,)) * u, np.where(left < 0.0, ((0.0,), (-1.0,)) * left, functions))
    grows = bool(np.any(bends[6]))
    added = np.empty((7 if grows else 6, s.size))
    combine(bends[: len(added)], functions, counts, added)
    turns, advances = twists.exponential(added[:6])
    out[:3] += rotate(out[3:7].T, advances.T).T
    out[3:7] = multiply(out[3:7].T, turns.T).T
    if grows:
        out[7] *= np.exp(np.clip(added[6], -MOST_GROWTH, MOST_GROWTH, out=added[6]))


def _ends(vectors: np.ndarray) -> Ends:
    """Return vectors (..., n, k) at the beginnings and ends of segments, as contiguous components (k, ..., n - 1)."""
    rows = components(vectors)
    return np.ascontiguousarray(rows[..., :-1]), np.ascontiguousarray(rows[..., 1:])


def _flat(rows: np.ndarray) -> np.ndarray:
    """Return components (k, ...) flattened to (k, S), contiguous."""
    return np.ascontiguousarray(rows).reshape(len(rows), -1)


def in_one_place(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return whether positions `begin` and `end` (3, ...) are equal except for rounding, shape (...)."""
    return np.asarray(np.abs(end - begin).max(axis=0) < MAX_SAME_POSE_CHANGE)


def _length(components: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("k...,k...->...", components, components))
