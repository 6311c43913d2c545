"""Segments: everything between two successive keys that does not depend on the moment, worked out once.

Both keys of a segment are described from the pose half-way, with s = 2 u - 1 from -1 to 1 instead of u from 0 to 1. Of the
quaternions q0 and q1 on either side, the sum and the difference are orthogonal: with their directions m and d and with h,
a quarter of the angle turned, every mode's rotation is

    q = m cos(psi) + d sin(psi),        psi = s h (slerp)  or  tan(psi) = s tan(h) (normalised lerp),

the axis of the turn is n = d m*, and every position is a sum of a few fixed vectors, each times a function of psi and s.
Nothing is divided by an angle that may vanish but together with the sine of that same angle: there is no special case
for small turns, and none at 180 degrees.

A mode's fast form is a function from `Segments` to `Curves`; they are in `addon.motion.curves`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .poses import Poses
from .quaternions import align_signs, conjugate, multiply

BLOCK = 8192
"""In-betweens worked on at once: what fits the processor's second-level cache."""

DENSE = 128
"""In-betweens in a row with equally many in each segment, from which on a matrix product beats repeating coefficients."""

SMALLEST_ANGLE = 1e-150
"""Stands for an angle of zero, where only ratios of angles count; its square is still above the smallest float."""


@dataclass(frozen=True, eq=False)
class Segments:
    """S segments, one after the other along the last axis of each array."""

    mid_time: np.ndarray
    """Shape (S,), seconds."""

    rate: np.ndarray
    """Change of s in a second, shape (S,)."""

    centre: np.ndarray
    """Half-way between the positions, shape (3, S)."""

    chord: np.ndarray
    """From the first position to the second, shape (3, S)."""

    middle: np.ndarray
    """m, the rotation half-way, shape (4, S)."""

    difference: np.ndarray
    """d, the direction from the first quaternion to the second, shape (4, S); zero where they are equal."""

    quarter_angle: np.ndarray
    """h, from 0 to pi / 4, a quarter of the angle between the rotations, shape (S,)."""

    axis: np.ndarray
    """n, the axis of the turn, shape (3, S); zero where nothing turns."""

    scales: np.ndarray | None
    """The scales at both ends, shape (2, S), or None."""

    @classmethod
    def between(cls, key_times: np.ndarray, keys: Poses) -> Segments:
        """The n - 1 segments of each object: times of shape (..., n), keys of shape (..., n), signs aligned."""
        starts, durations = key_times[..., :-1], np.diff(key_times)
        shape = keys.shape[:-1] + (keys.shape[-1] - 1,)
        first, second = _components(keys.quaternions[..., :-1, :]), _components(keys.quaternions[..., 1:, :])
        begin, end = _components(keys.positions[..., :-1, :]), _components(keys.positions[..., 1:, :])
        total, change = first + second, second - first
        total_length, change_length = _length(total), _length(change)
        middle, difference = total / total_length, change / np.maximum(change_length, SMALLEST_ANGLE)
        return cls(
            mid_time=np.broadcast_to(starts + 0.5 * durations, shape).ravel(),
            rate=np.broadcast_to(2.0 / durations, shape).ravel(),
            centre=0.5 * (begin + end),
            chord=end - begin,
            middle=middle,
            difference=difference,
            quarter_angle=np.maximum(np.arctan2(change_length, total_length), SMALLEST_ANGLE),
            axis=multiply(difference.T, conjugate(middle.T)).T[1:],
            scales=None
            if keys.scales is None
            else np.stack((keys.scales[..., :-1].ravel(), keys.scales[..., 1:].ravel())),
        )


Basis = Callable[[np.ndarray, np.ndarray, bool], tuple[np.ndarray, np.ndarray, "np.ndarray | None"]]


@dataclass(frozen=True, eq=False)
class Curves:
    """What a mode makes of S segments: quaternion = Q b(s), position = P c(s), with b and c of the mode's choice."""

    quaternions: np.ndarray
    """Q, shape (4, basis functions b, S)."""

    positions: np.ndarray
    """P, shape (3, basis functions c, S)."""

    parameters: np.ndarray
    """The numbers of each segment that b and c need, shape (parameters, S)."""

    basis: Basis
    """(s (n,), parameters (parameters, n), whether all s are within [-1, 1]) -> b (., n), c (., n), scales (n,) or None."""


def interpolate_along(
    curves: Callable[[Segments], Curves], key_times: np.ndarray, keys: Poses, times: np.ndarray, extrapolate: bool
) -> Poses:
    """Poses of shape (..., m) between at least two keys (..., n), at rising times (..., m).

    `key_times` and `times` may leave out leading axes that all objects share. Quaternions of keys are unit.
    """
    segments = Segments.between(key_times, Poses(keys.positions, align_signs(keys.quaternions), keys.scales))
    shape = keys.shape[:-1] + times.shape[-1:]
    bounds = _sample_bounds(key_times, times, keys.shape)
    samples = np.broadcast_to(times, shape).ravel()
    result = np.empty((8 if keys.scales is not None else 7, samples.size))
    mode = curves(segments)
    timing = np.stack((segments.mid_time, segments.rate))
    for segment, sample in _blocks(bounds):
        counts = np.diff(bounds[segment.start : segment.stop + 1])
        mid_time, rate, *parameters = np.repeat(
            np.concatenate((timing[:, segment], mode.parameters[:, segment])), counts, axis=1
        )
        s = (samples[sample] - mid_time) * rate
        if not extrapolate:
            np.clip(s, -1.0, 1.0, out=s)
        turn, travel, scales = mode.basis(s, np.asarray(parameters), not extrapolate)
        _combine(mode.positions[..., segment], travel, counts, result[:3, sample])
        _combine(mode.quaternions[..., segment], turn, counts, result[3:7, sample])
        if scales is not None:
            result[7, sample] = scales
    return Poses(
        result[:3].T.reshape(*shape, 3),
        result[3:7].T.reshape(*shape, 4),
        None if keys.scales is None else result[7].reshape(shape),
    )


def _sample_bounds(key_times: np.ndarray, times: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Where each segment's samples begin among the samples of all objects, shape (S + 1,)."""
    objects, keys, samples = int(np.prod(shape[:-1])), shape[-1], times.shape[-1]
    starts = np.zeros((objects, keys - 1), dtype=np.int64)
    if keys > 2:
        inner = key_times[..., 1:-1]
        if inner.ndim == 1 and times.ndim == 1:
            starts[:, 1:] = np.searchsorted(times, inner, side="right")
        else:
            inner = np.broadcast_to(inner, shape[:-1] + (keys - 2,)).reshape(objects, keys - 2)
            own_times = np.broadcast_to(times, shape[:-1] + (samples,)).reshape(objects, samples)
            for row in range(objects):
                starts[row, 1:] = np.searchsorted(own_times[row], inner[row], side="right")
    starts += samples * np.arange(objects)[:, None]
    return np.append(starts.ravel(), objects * samples)


def _blocks(bounds: np.ndarray) -> Iterator[tuple[slice, slice]]:
    """Slices of segments and of their samples, of about `BLOCK` samples each."""
    cuts = np.unique(np.append(np.searchsorted(bounds, np.arange(0, bounds[-1], BLOCK)), len(bounds) - 1))
    for first, last in zip(cuts[:-1], cuts[1:], strict=True):
        yield slice(int(first), int(last)), slice(int(bounds[first]), int(bounds[last]))


def _combine(coefficients: np.ndarray, basis: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """out (k, n) = coefficients (k, b, S) of each sample's segment times basis (b, n); segment i has counts[i] samples."""
    changes = np.flatnonzero(np.diff(counts)) + 1
    if counts.sum() < DENSE * (len(changes) + 1) or counts.min() < 8:
        np.einsum("kbn,bn->kn", np.repeat(coefficients, counts, axis=2), basis, out=out)
        return
    matrices = np.ascontiguousarray(np.moveaxis(coefficients, -1, 0))
    starts = np.append(0, np.cumsum(counts))
    for first, last in zip(np.append(0, changes), np.append(changes, len(counts)), strict=True):
        stretch, shape = slice(starts[first], starts[last]), (-1, last - first, counts[first])
        np.matmul(
            matrices[first:last],
            basis[:, stretch].reshape(shape).transpose(1, 0, 2),
            out=out[:, stretch].reshape(shape).transpose(1, 0, 2),
        )


def _components(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., k) one after the other as components (k, S)."""
    return np.ascontiguousarray(vectors.reshape(-1, vectors.shape[-1]).T)


def _length(components: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("ks,ks->s", components, components))
